//! What a run leaves to its results, value by value.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A list that one part of a simulation fills and the results read; clones are the same list.
///
/// It is to be filled by one actor or one observer. Actors of several hosts may run at the same
/// time, so that the order of what they push would not be the same in every run.
///
/// ```
/// use farside_actors::system::Gathered;
/// let heights_m = Gathered::default();
/// let of_actor = heights_m.clone();
/// of_actor.push(0.5);
/// assert_eq!((heights_m.len(), heights_m.take()), (1, vec![0.5]));
/// assert!(of_actor.is_empty());
/// ```
#[derive(Debug)]
pub struct Gathered<T>(Arc<Mutex<Vec<T>>>);

impl<T> Gathered<T> {
    /// Appends a value.
    pub fn push(&self, value: T) {
        self.lock().push(value);
    }

    /// How many values there are.
    pub fn len(&self) -> usize {
        self.lock().len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.lock().is_empty()
    }

    /// All values so far; the list is empty then.
    pub fn take(&self) -> Vec<T> {
        std::mem::take(&mut self.lock())
    }

    /// The list, also of an actor that panicked: what it had pushed until then is whole.
    fn lock(&self) -> MutexGuard<'_, Vec<T>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T> Clone for Gathered<T> {
    fn clone(&self) -> Self {
        Gathered(self.0.clone())
    }
}

impl<T> Default for Gathered<T> {
    fn default() -> Self {
        Gathered(Arc::default())
    }
}
