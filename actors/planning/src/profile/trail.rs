//! What edits changed, so that they can be undone: all since a push.

use super::{Profile, Use, UseId};

/// A change, with what was there before.
#[derive(Clone, Debug)]
pub(super) enum Change<O> {
    Added(UseId),
    Updated(UseId, Use),
    Removed(UseId, Use, O),
    Initial(i64),
}

impl<O: Clone> Profile<O> {
    /// From here on changes are kept, until [`pop`](Self::pop) undoes them.
    pub fn push(&mut self) {
        self.levels.push(self.trail.len());
    }

    /// Undoes all changes since the last [`push`](Self::push) that was not undone, each for what it
    /// cost. Without one, nothing happens.
    ///
    /// ```
    /// use farside_planning::profile::{Profile, Use};
    /// use farside_planning::temporal::Span;
    /// let mut memory = Profile::new(100, Span::new(0, 100));
    /// memory.push();
    /// memory.add(Use::consumption(Span::exactly(5), Span::exactly(40)), "picture").unwrap();
    /// assert_eq!(memory.level(5), Span::exactly(60));
    /// memory.pop();
    /// assert_eq!((memory.level(5), memory.len()), (Span::exactly(100), 0));
    /// ```
    pub fn pop(&mut self) {
        let Some(start) = self.levels.pop() else {
            return;
        };
        while self.trail.len() > start {
            match self.trail.pop() {
                Some(change) => self.undo(change),
                None => return,
            }
        }
    }

    /// Keeps the changes since the last [`push`](Self::push), as if that had not been.
    pub fn commit(&mut self) {
        self.levels.pop();
        if self.levels.is_empty() {
            self.trail.clear();
        }
    }

    /// How many pushes are neither undone nor committed.
    pub fn depth(&self) -> usize {
        self.levels.len()
    }

    pub(super) fn note(&mut self, change: Change<O>) {
        if !self.levels.is_empty() {
            self.trail.push(change);
        }
    }

    fn undo(&mut self, change: Change<O>) {
        match change {
            Change::Added(id) => {
                let one = self.uses.undo_insert(id);
                self.owners.truncate(self.uses.places());
                self.put_in(id, one, None);
            }
            Change::Initial(old) => self.initial = old,
            Change::Updated(id, old) => self.replace(id, old),
            Change::Removed(id, old, owner) => {
                self.uses.undo_remove(id, old);
                self.owners[id.index()] = owner;
                self.put_in(id, None, Some(old));
            }
        }
    }
}
