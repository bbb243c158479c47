//! That an executive's rules look forward only: a rule never inserts a token that starts before
//! its master does.
//!
//! An executive extends its timelines one latency ahead, so that it cannot put anything into the
//! past. The proof is a sufficient one: the relation that inserts a token must itself say that it
//! starts no earlier than its anchor, which must be the master or have been proved so before.

use crate::language::analyse::rule::Draft;
use crate::language::findings::{Notes, Severity};
use crate::model::{Body, Bound, Distance, End, Relation, Target};

/// Notes each relation of a rule that may insert a token before the master.
pub(super) fn check(draft: &Draft, notes: &mut Notes) {
    let mut proved = vec![false; draft.rule.labels];
    proved[0] = true;
    body(&draft.rule.body, &mut proved, notes);
}

fn body(of: &Body, proved: &mut [bool], notes: &mut Notes) {
    match of {
        Body::All(parts) | Body::Any(parts, _) => {
            for part in parts {
                body(part, proved, notes);
            }
        }
        Body::Relation(relation) => {
            let Target::New(_, label) = relation.target else {
                return;
            };
            // A condition inserts nothing, whenever its token started.
            proved[label] = !relation.condition && proved[relation.anchor] && is_forward(relation);
            if !relation.condition && !proved[label] {
                let expected = "a relation of an executive that inserts a token no earlier than \
                    its master, or a :condition";
                let found = "one that may insert it earlier";
                notes.note(Severity::Error, relation.position, expected, found);
            }
        }
    }
}

/// Whether a relation says that its target starts no earlier than its anchor.
fn is_forward(relation: &Relation) -> bool {
    let says = |distance: &Distance| {
        let Distance {
            from,
            to,
            min,
            max,
            backward,
        } = *distance;
        let exact = matches!((min, max), (_, Bound::Value(0)));
        match (from, to, backward) {
            // An anchor's end is no earlier than its start.
            (_, End::Start, false) => matches!(min, Bound::Value(least) if least >= 0),
            (End::Start, End::Start, true) => exact,
            _ => false,
        }
    };
    relation.distances.iter().any(says)
}
