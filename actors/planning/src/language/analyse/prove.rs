//! What can be proved of a model before any planner runs.

use super::rule::Draft;
use crate::language::findings::Notes;
use crate::model::Model;

/// Notes what is wrong with rules as a whole.
pub(super) fn check(_model: &Model, _drafts: &[Draft], _notes: &mut Notes) {}
