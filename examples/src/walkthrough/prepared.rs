//! What cullers need made of a world before they can be: trees, tessellations, baked sets. Made once, however many cullers ask.

use std::any::Any;
use std::mem;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Tells how many bytes are allocated.
type Memory = fn() -> usize;

/// What was made so far, by name.
#[derive(Default)]
pub struct Prepared {
    memory: Option<Memory>,
    made: Mutex<Vec<Made>>,
}

struct Made {
    name: String,
    value: Arc<dyn Any + Send + Sync>,
    cost: Cost,
    /// It was made before whoever asks now, and not for him yet counted.
    reused: bool,
}

/// What it took to make something, and to keep it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Cost {
    /// The time.
    pub time: Duration,
    /// The memory; 0 if it is not measured.
    pub bytes: usize,
}

impl Prepared {
    /// Measures memory too.
    pub fn measuring(memory: Memory) -> Self {
        Self { memory: Some(memory), made: Mutex::default() }
    }

    /// What goes by a name, made unless it is there.
    ///
    /// # Errors
    /// Those of `make`.
    ///
    /// # Panics
    /// If the name stands for something of another type.
    pub fn get<T: Send + Sync + 'static>(
        &self,
        name: &str,
        make: impl FnOnce() -> Result<T, String>,
    ) -> Result<Arc<T>, String> {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let known = made.iter_mut().find(|known| known.name == name);
        let value = if let Some(known) = known {
            known.reused = true;
            known.value.clone()
        } else {
            let (start, before) = (Instant::now(), self.bytes());
            let value: Arc<dyn Any + Send + Sync> = Arc::new(make()?);
            let cost = Cost { time: start.elapsed(), bytes: self.bytes().saturating_sub(before) };
            made.push(Made { name: name.to_owned(), value: value.clone(), cost, reused: false });
            value
        };
        Ok(value.downcast().expect("a name stands for one type"))
    }

    /// What it would have taken to make all that was asked for since the last call and was there already.
    pub fn spared(&self) -> Cost {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let reused = made.iter_mut().filter_map(|made| mem::take(&mut made.reused).then_some(made.cost));
        reused.fold(Cost::default(), |sum, cost| Cost {
            time: sum.time + cost.time,
            bytes: sum.bytes + cost.bytes,
        })
    }

    fn bytes(&self) -> usize {
        self.memory.map_or(0, |memory| memory())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_there_is_not_made_again_but_its_cost_is_known() {
        let prepared = Prepared::measuring(|| 7);
        let slow = || {
            std::thread::sleep(Duration::from_millis(2));
            Ok(5_u32)
        };
        assert_eq!(*prepared.get("five", slow).unwrap(), 5);
        assert_eq!(prepared.spared(), Cost::default(), "who made it has paid");
        let again: Arc<u32> = prepared.get("five", || unreachable!("it is there")).unwrap();
        assert_eq!(*again, 5);
        assert!(prepared.spared().time >= Duration::from_millis(2));
        assert_eq!(prepared.spared(), Cost::default(), "counted once");
        assert_eq!(prepared.get::<u32>("none", || Err("no".to_owned())), Err("no".to_owned()));
    }
}
