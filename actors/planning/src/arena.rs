//! Values with ids that a later value in the same place does not answer to.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::marker::PhantomData;

/// An id of a value of an [`Arena`]. It is not given again: when its value is removed, it names
/// nothing. Only an id whose giving was undone is given again.
pub struct Id<T> {
    index: u32,
    generation: u32,
    of: PhantomData<fn() -> T>,
}

impl<T> Id<T> {
    /// The place of the value. Places are dense, and are given again.
    pub fn index(self) -> usize {
        self.index as usize
    }
}

// Derived, these would ask the same of `T`.
impl<T> Clone for Id<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Id<T> {}

impl<T> PartialEq for Id<T> {
    fn eq(&self, other: &Self) -> bool {
        (self.index, self.generation) == (other.index, other.generation)
    }
}

impl<T> Eq for Id<T> {}

impl<T> PartialOrd for Id<T> {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl<T> Ord for Id<T> {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        (self.index, self.generation).cmp(&(other.index, other.generation))
    }
}

impl<T> Hash for Id<T> {
    fn hash<H: Hasher>(&self, state: &mut H) {
        (self.index, self.generation).hash(state);
    }
}

impl<T> fmt::Debug for Id<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.index, self.generation)
    }
}

/// Values by id. What is undone in the opposite order leaves the arena as it was, ids to be given
/// among it.
///
/// ```
/// use farside_planning::arena::Arena;
/// let mut arena = Arena::new();
/// let first = arena.insert("first");
/// assert_eq!(arena.remove(first), Some("first"));
/// let second = arena.insert("second");
/// assert_eq!((second.index(), first.index()), (0, 0));
/// assert_eq!((arena.get(first), arena.get(second)), (None, Some(&"second")));
/// ```
#[derive(Clone)]
pub struct Arena<T> {
    slots: Vec<Slot<T>>,
    /// Places without a value, the last to be given first.
    free: Vec<u32>,
}

#[derive(Clone)]
struct Slot<T> {
    generation: u32,
    value: Option<T>,
}

impl<T> Default for Arena<T> {
    fn default() -> Self {
        Arena {
            slots: Vec::new(),
            free: Vec::new(),
        }
    }
}

impl<T> Arena<T> {
    /// Without values.
    pub fn new() -> Self {
        Arena::default()
    }

    /// How many values there are.
    pub fn len(&self) -> usize {
        self.slots.len() - self.free.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How many places there are: more than any id's index.
    pub fn places(&self) -> usize {
        self.slots.len()
    }

    /// Takes a value in.
    ///
    /// # Panics
    ///
    /// With 2^32 values.
    pub fn insert(&mut self, value: T) -> Id<T> {
        if let Some(index) = self.free.pop() {
            let slot = &mut self.slots[index as usize];
            slot.value = Some(value);
            return Id::new(index, slot.generation);
        }
        let index = u32::try_from(self.slots.len()).expect("fewer than 2^32 values");
        self.slots.push(Slot {
            generation: 0,
            value: Some(value),
        });
        Id::new(index, 0)
    }

    /// Takes a value out, if it is there.
    pub fn remove(&mut self, id: Id<T>) -> Option<T> {
        let slot = self.slots.get_mut(id.index())?;
        if slot.generation != id.generation {
            return None;
        }
        let value = slot.value.take()?;
        slot.generation += 1;
        self.free.push(id.index);
        Some(value)
    }

    /// Drops a value where it is, if it is there.
    pub fn discard(&mut self, id: Id<T>) {
        if let Some(slot) = self.slots.get_mut(id.index())
            && slot.generation == id.generation
            && slot.value.is_some()
        {
            slot.value = None;
            slot.generation += 1;
            self.free.push(id.index);
        }
    }

    /// Undoes the last [`insert`](Self::insert), which gave this id.
    pub(crate) fn undo_insert(&mut self, id: Id<T>) -> Option<T> {
        let value = self.slots.get_mut(id.index())?.value.take();
        // A place that was never another value's goes with it.
        if id.generation == 0 && id.index() + 1 == self.slots.len() {
            self.slots.pop();
        } else {
            self.free.push(id.index);
        }
        value
    }

    /// Undoes the last [`remove`](Self::remove), of this id and value.
    pub(crate) fn undo_remove(&mut self, id: Id<T>, value: T) {
        let free = self.free.pop();
        debug_assert_eq!(free, Some(id.index), "undone in the opposite order");
        let slot = &mut self.slots[id.index()];
        slot.generation = id.generation;
        slot.value = Some(value);
    }

    /// The value, if it is there.
    pub fn get(&self, id: Id<T>) -> Option<&T> {
        let slot = self.slots.get(id.index())?;
        slot.value
            .as_ref()
            .filter(|_| slot.generation == id.generation)
    }

    /// The value, to be changed, if it is there.
    pub fn get_mut(&mut self, id: Id<T>) -> Option<&mut T> {
        let slot = self.slots.get_mut(id.index())?;
        let generation = slot.generation;
        slot.value.as_mut().filter(|_| generation == id.generation)
    }

    /// The value in a place, if there is one.
    pub fn at(&self, index: usize) -> Option<&T> {
        self.slots.get(index)?.value.as_ref()
    }

    /// The value in a place, to be changed, if there is one.
    pub fn at_mut(&mut self, index: usize) -> Option<&mut T> {
        self.slots.get_mut(index)?.value.as_mut()
    }

    /// The id of the value in a place, if there is one.
    pub fn id_at(&self, index: usize) -> Option<Id<T>> {
        let slot = self.slots.get(index)?;
        slot.value.as_ref()?;
        Some(Id::new(index as u32, slot.generation))
    }

    /// All values with their ids, place by place.
    pub fn iter(&self) -> impl Iterator<Item = (Id<T>, &T)> {
        let slots = (0..).zip(&self.slots);
        slots.filter_map(|(index, slot)| {
            let value = slot.value.as_ref()?;
            Some((Id::new(index, slot.generation), value))
        })
    }
}

impl<T> Id<T> {
    fn new(index: u32, generation: u32) -> Self {
        Id {
            index,
            generation,
            of: PhantomData,
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[derive(Clone, Copy, Debug)]
    enum Edit {
        Insert(u8),
        Remove(usize),
    }

    fn edits() -> impl Strategy<Value = Vec<Edit>> {
        let edit = prop_oneof![
            any::<u8>().prop_map(Edit::Insert),
            (0..12usize).prop_map(Edit::Remove),
        ];
        prop::collection::vec(edit, 0..40)
    }

    type State = (Vec<(Id<u8>, u8)>, Vec<u32>, usize);

    fn state(arena: &Arena<u8>) -> State {
        let all = arena.iter().map(|(id, value)| (id, *value)).collect();
        (all, arena.free.clone(), arena.places())
    }

    proptest! {
        /// Undone in the opposite order, edits leave what was there, and old ids name nothing.
        #[test]
        fn edits_are_undone(before in edits(), after in edits()) {
            let mut arena = Arena::new();
            let mut given = Vec::new();
            let mut undo = Vec::new();
            let mut start = None;
            let marked = before.len();
            for (at, edit) in before.into_iter().chain(after).enumerate() {
                if at == marked {
                    start = Some(state(&arena));
                }
                let done = match edit {
                    Edit::Insert(value) => {
                        let id = arena.insert(value);
                        prop_assert!(!given.contains(&id));
                        given.push(id);
                        (id, None)
                    }
                    Edit::Remove(place) => match arena.id_at(place) {
                        Some(id) => (id, arena.remove(id)),
                        None => continue,
                    },
                };
                if start.is_some() {
                    undo.push(done);
                }
            }
            for (id, removed) in undo.into_iter().rev() {
                match removed {
                    None => drop(arena.undo_insert(id)),
                    Some(value) => arena.undo_remove(id, value),
                }
            }
            if let Some(start) = start {
                prop_assert_eq!(state(&arena), start);
            }
        }
    }
}
