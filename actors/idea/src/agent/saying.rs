//! What timelines say, for the log: recorded where it is something else than before, so that a poll
//! that is asked again at every tick is not.

use std::sync::Arc;

use farside::prelude::*;
use farside_planning::model::{Model, PredicateId, TimelineId, Value};
use smallvec::SmallVec;

use super::Agent;
use crate::records::{GoalEnded, TimelineSays};
use crate::runner::{Cycle, RegisterSetup};
use crate::wording;

/// What each timeline said last.
#[derive(Default)]
pub(super) struct Saying {
    model: Option<Arc<Model>>,
    /// By timeline: the predicate and its inputs.
    last: Vec<Option<Said>>,
    /// Timelines of polls, of which statuses tell all.
    quiet: Vec<TimelineId>,
}

#[derive(PartialEq)]
struct Said {
    predicate: PredicateId,
    inputs: SmallVec<[Option<Value>; 4]>,
}

impl Saying {
    pub(super) fn new(model: &Arc<Model>, registers: &[RegisterSetup]) -> Self {
        let quiet = registers.iter().filter(|register| register.is_polled);
        Saying {
            quiet: quiet.map(|register| register.timeline).collect(),
            last: model.timelines.iter().map(|_| None).collect(),
            model: Some(model.clone()),
        }
    }

    /// Records what begins to say something else, and what has become of others' goals.
    pub(super) fn record(&mut self, cycle: &Cycle, ctx: &mut Context<'_, Agent>) {
        let Some(model) = &self.model else {
            return;
        };
        for (register, ended) in &cycle.answered {
            ctx.sample(&GoalEnded {
                register: register.to_string(),
                goal: wording::words(model, ended.predicate, &ended.parameters),
                outputs: wording::output_words(model, ended.predicate, &ended.parameters),
            });
        }
        for token in &cycle.begun {
            let timeline = usize::from(token.contract.timeline);
            if self.quiet.contains(&timeline) {
                continue;
            }
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
