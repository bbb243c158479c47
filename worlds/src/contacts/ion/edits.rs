//! Contacts and ranges as a file goes on: it may change and delete those that it added before.

use std::collections::BTreeMap;
use std::ops::Bound;

use super::super::build;
use super::super::{ContactError, MAX_CONTACTS};
use super::time::Stamp;
use super::{Contact, KINDS, Reader, Words};

const CHANGE_FORM: &str = "c contact start from to bytes_per_second [confidence]";
const DELETE_FORM: &str = "d contact|range start|* from to";

/// What identifies an entry: its nodes, and when it begins.
pub(super) type Name = (u32, u32, Stamp);

/// Contacts or ranges, in the order of the file.
pub(super) struct Entries<T> {
    all: Vec<Option<T>>,
    by_name: BTreeMap<Name, Vec<usize>>,
}

impl<T> Default for Entries<T> {
    fn default() -> Self {
        Entries {
            all: Vec::new(),
            by_name: BTreeMap::new(),
        }
    }
}

impl<T> Entries<T> {
    pub(super) fn iter(&self) -> impl Iterator<Item = &T> {
        self.all.iter().flatten()
    }

    /// One more, unless there are too many.
    pub(super) fn push(
        &mut self,
        name: Name,
        entry: T,
        what: &'static str,
        line: usize,
    ) -> Result<(), ContactError> {
        if self.all.len() == MAX_CONTACTS {
            return Err(build::too_many(what, line));
        }
        self.by_name.entry(name).or_default().push(self.all.len());
        self.all.push(Some(entry));
        Ok(())
    }

    /// Those from one node to another that begin then.
    fn named(&mut self, name: Name, mut each: impl FnMut(&mut T)) -> bool {
        let found = self.by_name.get(&name);
        for at in found.into_iter().flatten() {
            self.all[*at].iter_mut().for_each(&mut each);
        }
        found.is_some()
    }

    /// Forgets those that begin then, or all of the pair; returns whether there were any.
    fn delete(&mut self, from: u32, to: u32, start: Option<Stamp>) -> bool {
        let names: Vec<Name> = match start {
            Some(start) => vec![(from, to, start)],
            None => {
                let first = Bound::Included((from, to, Stamp::Relative(i128::MIN)));
                let last = Bound::Included((from, to, Stamp::Absolute(i128::MAX)));
                let names = self.by_name.range((first, last));
                names.map(|(name, _)| *name).collect()
            }
        };
        let mut any = false;
        for name in names {
            for at in self.by_name.remove(&name).into_iter().flatten() {
                any |= self.all[at].take().is_some();
            }
        }
        any
    }
}

impl Reader {
    /// A command that changes a contact, or deletes contacts or ranges.
    pub(super) fn edit(
        &mut self,
        changes: bool,
        words: &mut Words<'_>,
    ) -> Result<(), ContactError> {
        let form = if changes { CHANGE_FORM } else { DELETE_FORM };
        let kind = words.field("contact or range", form)?;
        let is_contact = match kind.text {
            "contact" => true,
            "range" if !changes => false,
            _ if changes => return Err(words.directive(kind, "contact", &KINDS[..1])),
            _ => return Err(words.directive(kind, "contact or range", &KINDS)),
        };
        // Contacts that register a node, and hypothetical ones, are none here.
        if matches!(words.peek(), Some("0" | "-1")) {
            return Ok(());
        }
        let all = !changes && words.peek() == Some("*");
        let start = match all {
            true => words.next().map(|_| None),
            false => {
                let stamp = self.time(words, "start time", form);
                self.note(stamp)?.map(Some)
            }
        };
        let from = self.node(words, "sending node", form)?;
        let to = self.node(words, "receiving node", form)?;
        let change = match changes {
            true => Some(self.change(words)?),
            false => None,
        };
        words.end(form)?;
        let (Some(start), Some(from), Some(to)) = (start, from, to) else {
            return Ok(());
        };
        let any = match (change, start) {
            (Some(change), Some(start)) => self.contacts.named((from, to, start), change),
            _ if is_contact => self.contacts.delete(from, to, start),
            _ => self.ranges.delete(from, to, start),
        };
        if !any {
            let what = kind.text;
            let text = || format!("there is no such {what}: the command is passed over");
            self.found.remarks.push(words.number, text);
        }
        Ok(())
    }

    /// What a command sets anew in a contact.
    fn change(
        &mut self,
        words: &mut Words<'_>,
    ) -> Result<impl FnMut(&mut Contact) + use<>, ContactError> {
        let rate = words.field("rate in bytes per second", CHANGE_FORM)?;
        let rate = self.note(words.rate(rate))?;
        let confidence = words.next().map(|word| words.confidence(word));
        let confidence = self.note(confidence.transpose())?.flatten();
        Ok(move |contact: &mut Contact| {
            contact.rate_bit_per_s = rate.unwrap_or(contact.rate_bit_per_s);
            contact.confidence = confidence.or(contact.confidence);
        })
    }
}
