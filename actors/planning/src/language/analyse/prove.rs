//! What can be proved of rules before any planner runs.

mod consistent;
mod endings;
mod forward;
mod recursion;

use super::rule::Draft;
use crate::language::findings::Notes;
use crate::model::{Body, Model, Profile, Relation};

/// Notes what is wrong with rules as a whole.
pub(super) fn check(model: &Model, drafts: &[Draft], notes: &mut Notes) {
    for draft in drafts {
        consistent::check(model, draft, notes);
    }
    recursion::check(model, drafts, notes);
    if model.profile == Profile::Executive {
        for draft in drafts {
            forward::check(draft, notes);
        }
        endings::check(model, drafts, notes);
    }
}

/// The relations of a body that hold whichever alternatives are taken.
fn certain<'b>(body: &'b Body, found: &mut Vec<&'b Relation>) {
    match body {
        Body::All(parts) => parts.iter().for_each(|part| certain(part, found)),
        Body::Any(parts, _) if parts.len() == 1 => certain(&parts[0], found),
        Body::Any(..) => {}
        Body::Relation(relation) => found.push(relation),
    }
}
