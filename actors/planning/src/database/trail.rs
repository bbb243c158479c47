//! What edits changed, so that they can be undone.

use super::rules::{Instance, Open};
use super::times::Mirror;
use super::{Conflict, Database, Guard, InstanceId, Lane, Level, Time, Token, TokenId};
use crate::model::TimelineId;
use crate::parameters::Operand;

/// A change of what the database itself keeps, with what was there before.
#[derive(Clone, Debug)]
pub(super) enum Change {
    TokenAdded(TokenId),
    /// What it was is the last of the tokens that were kept; so with the others.
    TokenChanged(TokenId),
    TokenRemoved(TokenId),
    /// What a parameter of a token was, and when it ended.
    Parameter(TokenId, usize, Operand),
    Finish(TokenId, Time),
    InstanceAdded(InstanceId),
    InstanceChanged(InstanceId),
    InstanceRemoved(InstanceId),
    Guard(InstanceId, Guard),
    Lane(TimelineId, Lane),
    /// Which token stood before or after one.
    Before(TokenId, Option<TokenId>),
    After(TokenId, Option<TokenId>),
    Opened,
    /// What was open is not: at which place it stood.
    Closed(usize, Open),
    Held(usize, u32),
    /// Whose time the point in a place was.
    Pointed(usize, Option<TokenId>),
    Watched(usize),
    Unwatched(usize, usize, InstanceId),
    Mirrored,
    MirrorChanged(usize, Mirror),
    Unmirrored(usize, Mirror),
}

impl Database {
    /// From here on changes are kept, until [`pop`](Self::pop) undoes them.
    pub fn push(&mut self) {
        self.levels.push(Level {
            start: self.trail.len(),
            serial: self.serial,
        });
        self.serial += 1;
        self.push_levels();
        self.network.push();
        self.store.push();
    }

    /// Undoes all changes since the last [`push`](Self::push) that was not undone. Without one,
    /// nothing happens.
    pub fn pop(&mut self) {
        let Some(Level { start, .. }) = self.levels.pop() else {
            return;
        };
        while self.trail.len() > start {
            let Some(change) = self.trail.pop() else {
                break;
            };
            self.steps += 1;
            self.undo(change);
        }
        self.network.pop();
        self.store.pop();
        self.equalities.clear();
        self.told.clear();
        self.pop_levels();
    }

    /// Keeps the changes since the last [`push`](Self::push), as if that had not been.
    pub fn commit(&mut self) {
        self.levels.pop();
        if self.levels.is_empty() {
            self.trail.clear();
            self.kept_tokens.clear();
            self.kept_instances.clear();
        }
        self.commit_levels();
        self.network.commit();
        self.store.commit();
    }

    /// How many pushes are neither undone nor committed.
    pub fn depth(&self) -> usize {
        self.levels.len()
    }

    /// Does all of an edit or nothing of it. Within another edit it is a part of that: if it
    /// cannot be, neither can the other.
    pub(crate) fn attempt<T>(
        &mut self,
        edit: impl FnOnce(&mut Self) -> Result<T, Conflict>,
    ) -> Result<T, Conflict> {
        if self.edits {
            return edit(self);
        }
        self.push();
        let outcome = self.settled(edit);
        match outcome {
            Ok(_) => self.commit(),
            Err(_) => self.pop(),
        }
        outcome
    }

    /// Does an edit. If it cannot be, a part of it is left, and the caller undoes it with what
    /// was done before.
    pub(crate) fn settled<T>(
        &mut self,
        edit: impl FnOnce(&mut Self) -> Result<T, Conflict>,
    ) -> Result<T, Conflict> {
        let outer = std::mem::replace(&mut self.edits, true);
        let outcome = edit(self);
        let settled = match (&outcome, outer) {
            (Ok(_), false) => self.settle(),
            _ => Ok(()),
        };
        self.edits = outer;
        settled.and(outcome)
    }

    /// Does an edit that only takes away.
    pub(super) fn take(&mut self, edit: impl FnOnce(&mut Self)) {
        let settled = self.settled(|database| {
            edit(database);
            Ok(())
        });
        debug_assert!(settled.is_ok(), "less holds than before: {settled:?}");
    }

    #[inline]
    pub(super) fn note(&mut self, change: Change) {
        self.steps += 1;
        if !self.levels.is_empty() {
            self.trail.push(change);
        }
    }

    /// A token, to be changed: what it was is kept.
    pub(super) fn change(&mut self, token: TokenId) -> &mut Token {
        self.steps += 1;
        let at = self.tokens.get_mut(token).expect("the token is there");
        if let Some(level) = self.levels.last()
            && at.kept <= level.serial
        {
            self.kept_tokens.push(at.clone());
            self.trail.push(Change::TokenChanged(token));
            at.kept = self.serial;
        }
        at
    }

    /// An instance, to be changed: what it was is kept.
    pub(super) fn change_instance(&mut self, instance: InstanceId) -> &mut Instance {
        self.steps += 1;
        let at = self.instances.get_mut(instance);
        let at = at.expect("the instance is there");
        if let Some(level) = self.levels.last()
            && at.kept <= level.serial
        {
            self.kept_instances.push(at.clone());
            self.trail.push(Change::InstanceChanged(instance));
            at.kept = self.serial;
        }
        at
    }

    /// Says which token stands before one: a token of which nothing else changes is not kept.
    pub(super) fn set_before(&mut self, token: TokenId, before: Option<TokenId>) {
        let at = self.tokens.get_mut(token).expect("the token is there");
        let old = std::mem::replace(&mut at.before, before);
        self.note(Change::Before(token, old));
    }

    /// Says which token stands after one.
    pub(super) fn set_after(&mut self, token: TokenId, after: Option<TokenId>) {
        let at = self.tokens.get_mut(token).expect("the token is there");
        let old = std::mem::replace(&mut at.after, after);
        self.note(Change::After(token, old));
    }

    /// Gives a token another parameter.
    pub(super) fn set_parameter(&mut self, token: TokenId, place: usize, operand: Operand) {
        let at = self.tokens.get_mut(token).expect("the token is there");
        let old = std::mem::replace(&mut at.parameters[place], operand);
        self.note(Change::Parameter(token, place, old));
    }

    /// Gives a token another end.
    pub(super) fn set_finish(&mut self, token: TokenId, finish: Time) {
        let at = self.tokens.get_mut(token).expect("the token is there");
        let old = std::mem::replace(&mut at.finish, finish);
        self.note(Change::Finish(token, old));
    }

    /// Says whether a rule holds.
    pub(super) fn set_guard(&mut self, instance: InstanceId, guard: Guard) {
        let at = self.instances.get_mut(instance);
        let at = at.expect("the instance is there");
        let old = std::mem::replace(&mut at.guard, guard);
        self.note(Change::Guard(instance, old));
    }

    pub(super) fn change_lane(&mut self, timeline: TimelineId) -> &mut Lane {
        let lane = self.lanes[timeline];
        self.note(Change::Lane(timeline, lane));
        &mut self.lanes[timeline]
    }

    pub(super) fn push_open(&mut self, open: Open) {
        self.open.push(open);
        self.note(Change::Opened);
    }

    /// What was open is not, if it was.
    pub(super) fn close_open(&mut self, open: Open) {
        if let Some(place) = self.open.iter().position(|&at| at == open) {
            self.open.remove(place);
            self.note(Change::Closed(place, open));
        }
    }

    fn undo(&mut self, change: Change) {
        match change {
            Change::TokenAdded(token) => drop(self.tokens.undo_insert(token)),
            Change::TokenChanged(token) => {
                let before = self.kept_tokens.pop().expect("kept with its change");
                if let Some(at) = self.tokens.get_mut(token) {
                    *at = before;
                }
            }
            Change::TokenRemoved(token) => {
                let before = self.kept_tokens.pop().expect("kept with its change");
                self.tokens.undo_remove(token, before);
            }
            Change::Parameter(token, place, operand) => {
                if let Some(at) = self.tokens.get_mut(token) {
                    at.parameters[place] = operand;
                }
            }
            Change::Finish(token, finish) => {
                if let Some(at) = self.tokens.get_mut(token) {
                    at.finish = finish;
                }
            }
            Change::Guard(instance, guard) => {
                if let Some(at) = self.instances.get_mut(instance) {
                    at.guard = guard;
                }
            }
            Change::InstanceAdded(instance) => drop(self.instances.undo_insert(instance)),
            Change::InstanceChanged(instance) => {
                let before = self.kept_instances.pop().expect("kept with its change");
                if let Some(at) = self.instances.get_mut(instance) {
                    *at = before;
                }
            }
            Change::InstanceRemoved(instance) => {
                let before = self.kept_instances.pop().expect("kept with its change");
                self.instances.undo_remove(instance, before);
            }
            Change::Lane(timeline, lane) => self.lanes[timeline] = lane,
            Change::Before(token, before) => {
                if let Some(at) = self.tokens.get_mut(token) {
                    at.before = before;
                }
            }
            Change::After(token, after) => {
                if let Some(at) = self.tokens.get_mut(token) {
                    at.after = after;
                }
            }
            Change::Opened => drop(self.open.pop()),
            Change::Closed(place, open) => self.open.insert(place, open),
            Change::Held(place, count) => self.holders[place] = count,
            Change::Pointed(place, token) => self.token_of_point[place] = token,
            Change::Watched(place) => drop(self.watchers[place].pop()),
            Change::Unwatched(place, at, instance) => self.watchers[place].insert(at, instance),
            Change::Mirrored => drop(self.mirrors.pop()),
            Change::MirrorChanged(place, mirror) => self.mirrors[place] = mirror,
            Change::Unmirrored(place, mirror) => self.mirrors.insert(place, mirror),
        }
    }
}
