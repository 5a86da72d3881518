//! What cullers need made of a world before they can be: trees, tessellations, baked sets. Made once, however
//! many cullers ask.

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
    /// It was asked for again since costs were last told.
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
            let (value, cost) = self.measure(make);
            let value: Arc<dyn Any + Send + Sync> = Arc::new(value?);
            made.push(Made { name: name.to_owned(), value: value.clone(), cost, reused: false });
            value
        };
        Ok(value.downcast().expect("a name stands for one type"))
    }

    /// Runs what may ask for preparations, and tells what that cost: what was there already counts as if it
    /// had been made for it.
    pub fn cost_of<R>(&self, ask: impl FnOnce() -> R) -> (R, Cost) {
        self.take_reused();
        let (answer, mut cost) = self.measure(ask);
        for reused in self.take_reused() {
            cost.time += reused.time;
            cost.bytes += reused.bytes;
        }
        (answer, cost)
    }

    /// The costs of what was reused since the last call.
    fn take_reused(&self) -> Vec<Cost> {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        made.iter_mut().filter_map(|made| mem::take(&mut made.reused).then_some(made.cost)).collect()
    }

    fn measure<R>(&self, run: impl FnOnce() -> R) -> (R, Cost) {
        let bytes = || self.memory.map_or(0, |memory| memory());
        let (start, before) = (Instant::now(), bytes());
        let answer = run();
        (answer, Cost { time: start.elapsed(), bytes: bytes().saturating_sub(before) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_there_is_not_made_again_but_counts_again() {
        let prepared = Prepared::measuring(|| 7);
        let slow = || {
            std::thread::sleep(Duration::from_millis(2));
            Ok(5_u32)
        };
        assert_eq!(*prepared.get("five", slow).unwrap(), 5);
        let again = || prepared.get::<u32>("five", || unreachable!("it is there"));
        let (five, cost) = prepared.cost_of(again);
        assert!(*five.unwrap() == 5 && cost.time >= Duration::from_millis(2));
        again().unwrap();
        let (none, cost) = prepared.cost_of(|| prepared.get::<u32>("none", || Err("no".to_owned())));
        assert!(
            none.is_err() && cost.time < Duration::from_millis(2),
            "{cost:?}: what others asked for counts not"
        );
    }
}
