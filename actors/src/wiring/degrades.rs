//! Degradations of links, what links have with them, and which of them have no effect.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::pattern::Pattern;
use crate::link::{Degrade, LinkOverrides, LinkParams, Timeline};

/// A degradation of links.
pub(super) struct Worse {
    /// Its place among `[[degrade]]`.
    pub(super) number: usize,
    pub(super) pattern: Pattern,
    pub(super) when: Degrade,
    pub(super) over: LinkOverrides,
}

/// The timeline of all links with one base and one set of degradations.
pub(super) struct SharedTimeline {
    pub(super) base: Arc<LinkParams>,
    /// Indices into the degradations.
    pub(super) degrades: Vec<usize>,
    /// The same for each change of all that links have.
    pub(super) changed: Vec<(LinkParams, Vec<usize>)>,
    pub(super) timeline: Arc<Timeline>,
}

/// The keys that replace something.
fn keys(over: &LinkOverrides) -> BTreeSet<String> {
    let table = toml::Table::try_from(over).unwrap_or_default();
    table.into_iter().map(|(key, _)| key).collect()
}

/// For each degradation of links, the keys that leave every link that it meets as it is: it has the
/// same value anyway, and no other degradation meanwhile sets the key.
pub(super) fn without_effect(degrades: &[Worse], known: &[SharedTimeline]) -> Vec<String> {
    let mut remarks = Vec::new();
    for (index, worse) in degrades.iter().enumerate() {
        if worse.over.preset.is_some() {
            // Of its many keys some are the same, as one expects.
            continue;
        }
        let mut idle = keys(&worse.over);
        for link in known.iter().filter(|link| link.degrades.contains(&index)) {
            let changed = link.base.changes_to(&link.base.with(&worse.over));
            idle.retain(|key| !keys(&changed).contains(key));
            if idle.is_empty() {
                break;
            }
            let others = link.degrades.iter().filter(|other| **other != index);
            for other in others.map(|&other| &degrades[other]) {
                if other.when.overlaps(&worse.when) {
                    let theirs = keys(&other.over);
                    let all = other.over.preset.is_some();
                    idle.retain(|key| !all && !theirs.contains(key));
                }
            }
        }
        let number = worse.number;
        remarks.extend(idle.iter().map(|key| {
            format!("degrade.{number}.{key} has no effect: its links have that value anyway")
        }));
    }
    remarks
}
