//! What timelines say, for the log: recorded where it is something else than before, so that a poll
//! that is asked again at every tick is not.

use std::sync::Arc;

use farside::prelude::*;
use farside_planning::model::{Model, PredicateId, Value};
use smallvec::SmallVec;

use super::Agent;
use crate::records::TimelineSays;
use crate::runner::Cycle;
use crate::wording;

/// What each timeline said last.
#[derive(Default)]
pub(super) struct Saying {
    model: Option<Arc<Model>>,
    /// By timeline: the predicate and its inputs.
    last: Vec<Option<Said>>,
}

#[derive(PartialEq)]
struct Said {
    predicate: PredicateId,
    inputs: SmallVec<[Option<Value>; 4]>,
}

impl Saying {
    pub(super) fn new(model: &Arc<Model>) -> Self {
        Saying {
            last: model.timelines.iter().map(|_| None).collect(),
            model: Some(model.clone()),
        }
    }

    /// Records what begins to say something else.
    pub(super) fn record(&mut self, cycle: &Cycle, ctx: &mut Context<'_, Agent>) {
        let Some(model) = &self.model else {
            return;
        };
        for token in &cycle.begun {
            let timeline = usize::from(token.contract.timeline);
            let inputs = model.predicates[token.predicate].inputs;
            let said = Said {
                predicate: token.predicate,
                inputs: token.parameters.iter().take(inputs).copied().collect(),
            };
            let last = &mut self.last[timeline];
            if last.as_ref() == Some(&said) {
                continue;
            }
            *last = Some(said);
            let mut ended = cycle.ended.iter().rev();
            let ended = ended.find(|one| usize::from(one.contract.timeline) == timeline);
            let before = ended.map_or_else(Vec::new, |ended| {
                wording::output_words(model, ended.predicate, &ended.parameters)
            });
            ctx.sample(&TimelineSays {
                timeline: model.timelines[timeline].name.clone(),
                says: wording::words(model, token.predicate, &token.parameters),
                before,
            });
        }
    }
}
