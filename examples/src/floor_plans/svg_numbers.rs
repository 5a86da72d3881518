//! Reader of lists of numbers in SVG attributes: path data, points, transforms.

/// Rest of the attribute's text that is still to be read: numbers, and in path data the letters of commands
/// between them.
pub(super) struct Numbers<'a>(pub(super) &'a str);

impl Numbers<'_> {
    fn skip(&mut self) {
        self.0 = self.0.trim_start_matches(|c: char| c.is_whitespace() || c == ',');
    }

    pub(super) fn is_at_end(&mut self) -> bool {
        self.skip();
        self.0.is_empty()
    }

    pub(super) fn command(&mut self) -> Option<char> {
        self.skip();
        let c = self.0.chars().next().filter(char::is_ascii_alphabetic)?;
        self.0 = &self.0[1..];
        Some(c)
    }

    pub(super) fn number(&mut self) -> Result<f64, String> {
        self.skip();
        let bytes = self.0.as_bytes();
        let (mut end, mut dots, mut exponent) = (0, 0, false);
        while let Some(&c) = bytes.get(end) {
            let signed = end == 0 || matches!(bytes[end - 1], b'e' | b'E');
            match c {
                b'0'..=b'9' => {}
                b'+' | b'-' if signed => {}
                b'.' if dots == 0 && !exponent => dots = 1,
                b'e' | b'E' if !exponent && end > 0 => exponent = true,
                _ => break,
            }
            end += 1;
        }
        let (number, rest) = self.0.split_at(end);
        self.0 = rest;
        let wrong = || match rest.chars().take(12).collect::<String>() {
            rest if rest.is_empty() => "expected one more number".to_owned(),
            rest => format!("expected a number before `{rest}`"),
        };
        number.parse().map_err(|_| wrong())
    }

    /// Reads a flag of an arc: a single digit, after which no separator is needed.
    pub(super) fn flag(&mut self) -> Result<bool, String> {
        self.skip();
        let flag =
            self.0.chars().next().filter(|c| matches!(c, '0' | '1')).ok_or("expected a flag 0 or 1")?;
        self.0 = &self.0[1..];
        Ok(flag == '1')
    }

    pub(super) fn pair(&mut self) -> Result<[f64; 2], String> {
        Ok([self.number()?, self.number()?])
    }
}
