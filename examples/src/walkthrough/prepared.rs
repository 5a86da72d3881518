//! Cache of precomputed data that cullers need from a world: trees, tessellations, baked sets. Each item is
//! made once, however many cullers ask for it.

use std::any::Any;
use std::mem;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Function that returns the number of bytes that the program has allocated.
type Memory = fn() -> usize;

/// Cache of precomputed data of a world, by the name of each item. It can be shared between threads.
#[derive(Default)]
pub struct Prepared {
    memory: Option<Memory>,
    made: Mutex<Vec<Made>>,
}

struct Made {
    name: String,
    value: Arc<dyn Any + Send + Sync>,
    cost: Cost,
    /// Whether the item was asked for again since [`Prepared::take_reused`] was last called.
    reused: bool,
}

/// Cost of an item of precomputed data: the time to make it, and the memory that it keeps.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Cost {
    /// Wall-clock time to make the item.
    pub time: Duration,
    /// Memory in bytes that remained allocated after the item was made; 0 if memory is not measured.
    pub bytes: usize,
}

impl Prepared {
    /// Creates an empty cache that measures memory with the given function. The default cache measures only
    /// time.
    pub fn measuring(memory: Memory) -> Self {
        Self { memory: Some(memory), made: Mutex::default() }
    }

    /// Returns the item with this name, and makes it first if there is none. `make` must not call `get`,
    /// which would deadlock.
    ///
    /// # Errors
    ///
    /// Returns the error of `make`; no item is stored then.
    ///
    /// # Panics
    ///
    /// Panics if the item with this name has another type than `T`.
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

    /// Runs `ask` and returns its result with its cost. If `ask` gets an item from the cache, the full cost
    /// of making it counts.
    pub fn cost_of<R>(&self, ask: impl FnOnce() -> R) -> (R, Cost) {
        self.take_reused();
        let (answer, mut cost) = self.measure(ask);
        for reused in self.take_reused() {
            cost.time += reused.time;
            cost.bytes += reused.bytes;
        }
        (answer, cost)
    }

    /// Returns the costs of the items reused since the last call, and forgets that they were reused.
    fn take_reused(&self) -> Vec<Cost> {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        made.iter_mut().filter_map(|made| mem::take(&mut made.reused).then_some(made.cost)).collect()
    }

    /// Runs a function and returns its result with the time it took and the memory that it left allocated.
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
        assert_eq!(*prepared.get("five", slow).unwrap(), 5, "the value that was made");
        let again = || prepared.get::<u32>("five", || unreachable!("it is there"));
        let (five, cost) = prepared.cost_of(again);
        assert!(
            *five.unwrap() == 5 && cost.time >= Duration::from_millis(2),
            "the value is not made again, and its cost is told"
        );
        again().unwrap();
        let (none, cost) = prepared.cost_of(|| prepared.get::<u32>("none", || Err("no".to_owned())));
        assert!(
            none.is_err() && cost.time < Duration::from_millis(2),
            "{cost:?}: what others asked for counts not"
        );
    }
}
