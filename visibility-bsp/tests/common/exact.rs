//! Whole numbers of any size, to decide signs exactly: an oracle that shares no arithmetic with what it judges.

/// A whole number: sign and magnitude, least limb first.
#[derive(Clone, Debug)]
pub struct Whole {
    negative: bool,
    limbs: Vec<u32>,
}

impl Whole {
    /// `x * 2^scale`, which must be whole.
    pub fn of(x: f64, scale: i32) -> Self {
        let bits = x.to_bits();
        let exponent = (bits >> 52 & 0x7ff) as i32;
        let mantissa =
            if exponent == 0 { (bits & ((1 << 52) - 1)) << 1 } else { bits & ((1 << 52) - 1) | 1 << 52 };
        let shift = if mantissa == 0 { 0 } else { exponent - 1075 + scale };
        assert!(mantissa == 0 || shift >= 0 || mantissa.trailing_zeros() as i32 >= -shift, "{x} at {scale}");
        let (mantissa, shift) = if shift < 0 { (mantissa >> -shift, 0) } else { (mantissa, shift as usize) };
        let mut limbs = vec![0; shift / 32];
        let wide = u128::from(mantissa) << (shift % 32);
        limbs.extend([0, 32, 64].map(|s| (wide >> s) as u32));
        Self { negative: x < 0.0, limbs }.trim()
    }

    fn trim(mut self) -> Self {
        while self.limbs.last() == Some(&0) {
            self.limbs.pop();
        }
        self
    }

    pub fn times(&self, other: &Self) -> Self {
        let mut limbs = vec![0u32; self.limbs.len() + other.limbs.len()];
        for (i, &a) in self.limbs.iter().enumerate() {
            let mut carry = 0u64;
            for (j, &b) in other.limbs.iter().enumerate() {
                let sum = u64::from(a) * u64::from(b) + u64::from(limbs[i + j]) + carry;
                limbs[i + j] = sum as u32;
                carry = sum >> 32;
            }
            limbs[i + other.limbs.len()] = carry as u32;
        }
        Self { negative: self.negative != other.negative, limbs }.trim()
    }

    fn magnitude_less(&self, other: &Self) -> bool {
        let by_length = self.limbs.len().cmp(&other.limbs.len());
        by_length.then_with(|| self.limbs.iter().rev().cmp(other.limbs.iter().rev())).is_lt()
    }

    pub fn minus(&self, other: &Self) -> Self {
        self.plus(&Self { negative: !other.negative, limbs: other.limbs.clone() })
    }

    pub fn plus(&self, other: &Self) -> Self {
        let (large, small) = if self.magnitude_less(other) { (other, self) } else { (self, other) };
        let same = large.negative == small.negative;
        let mut limbs = Vec::with_capacity(large.limbs.len() + 1);
        let mut carry = 0i64;
        for i in 0..=large.limbs.len() {
            let a = i64::from(large.limbs.get(i).copied().unwrap_or(0));
            let b = i64::from(small.limbs.get(i).copied().unwrap_or(0));
            let sum = if same { a + b + carry } else { a - b + carry };
            limbs.push(sum as u32);
            carry = sum >> 32;
        }
        Self { negative: large.negative, limbs }.trim()
    }

    pub fn sign(&self) -> i32 {
        match (self.limbs.is_empty(), self.negative) {
            (true, _) => 0,
            (false, true) => -1,
            (false, false) => 1,
        }
    }
}

/// The sign of a determinant of three columns.
pub fn determinant(v: &[[Whole; 3]; 3]) -> i32 {
    let minor = |i: usize, j: usize| v[1][i].times(&v[2][j]).minus(&v[1][j].times(&v[2][i]));
    let [x, y, z] = [minor(1, 2), minor(2, 0), minor(0, 1)];
    v[0][0].times(&x).plus(&v[0][1].times(&y)).plus(&v[0][2].times(&z)).sign()
}

#[test]
fn signs_of_whole_numbers() {
    let w = |x: f64| Whole::of(x, 60);
    assert_eq!(w(3.5).minus(&w(3.5)).sign(), 0);
    assert_eq!(w(-3.5).plus(&w(3.25)).sign(), -1);
    assert_eq!(w(1024.0).times(&w(-1.0 / 1024.0)).plus(&Whole::of(1.0, 120)).sign(), 0);
    assert_eq!(
        determinant(&[[w(1.0), w(0.0), w(0.0)], [w(0.0), w(2.0), w(0.0)], [w(0.0), w(0.0), w(0.5)]]),
        1
    );
}
