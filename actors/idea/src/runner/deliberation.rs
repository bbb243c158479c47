//! Deliberation beside the cycles: it works on a snapshot in the time that cycles leave, and its plan
//! is taken between two cycles, if the snapshot still fits.

use std::sync::{MutexGuard, PoisonError};

use farside_planning::model::{PredicateId, TimelineId, Value};

use super::{Cycle, Runner};
use crate::deliberator::{Deliberator, Late, SharedDeliberator, Work};
use crate::register::{ContractEnd, ContractKey, RegisterLoad, RegisterValue};
use crate::service::{Contract, Snapshot};
use crate::wording;

/// A deliberative planner and what it is at.
pub(super) struct Deliberation {
    planner: SharedDeliberator,
    job: Option<Job>,
}

/// Work that takes its time.
struct Job {
    /// The token that asked for it.
    contract: Contract,
    snapshot: Snapshot,
    work: Work,
    /// Operations that are still to be done.
    left: u64,
}

impl Deliberation {
    /// The planner, to be told something. Nobody else has it while its agent lives.
    fn planner(&self) -> MutexGuard<'_, dyn Deliberator + 'static> {
        self.planner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn new(planner: SharedDeliberator) -> Self {
        Deliberation { planner, job: None }
    }

    /// The contract of a former life that is to be asked for, and its timeline.
    pub(super) fn unresolved(&self) -> Option<(TimelineId, ContractKey)> {
        self.planner().unresolved()
    }
}

impl Runner {
    /// Tells the deliberative planner what has begun and ended, and has it begin what is asked of it.
    /// Work whose token has ended is given up.
    pub(super) fn begin_deliberation(&mut self, cycle: &mut Cycle) {
        let Some(deliberation) = &mut self.deliberation else {
            return;
        };
        let mut planner = deliberation
            .planner
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        for token in &cycle.ended {
            planner.ended(token);
            deliberation
                .job
                .take_if(|job| job.contract == token.contract);
        }
        cycle.begun.iter().for_each(|token| planner.begun(token));
        cycle.given_up.extend(planner.gives_up());
        let timeline = planner.timeline();
        let mut asked = cycle.begun.iter().rev();
        let asked = asked.find(|token| usize::from(token.contract.timeline) == timeline);
        let Some(token) = asked else {
            return;
        };
        let snapshot = self.service.snapshot();
        deliberation.job = planner.work(token, &snapshot).map(|work| Job {
            contract: token.contract,
            snapshot,
            left: work.operations,
            work,
        });
    }

    /// Somebody has asked for this: a plan that it takes something back of does not go on, not even in
    /// this cycle.
    pub(super) fn tell_asked(&mut self, predicate: PredicateId, inputs: &[Value]) {
        let Some(deliberation) = &mut self.deliberation else {
            return;
        };
        let dropped = {
            let mut planner = deliberation.planner();
            planner.asked(predicate, inputs);
            planner.drops()
        };
        if let Some(timeline) = dropped {
            self.service.drop_plan(timeline);
            deliberation.job = None;
        }
    }

    /// A register was loaded with what begins on its timeline.
    pub(super) fn tell_loaded(&self, timeline: TimelineId, load: &RegisterLoad) {
        if let Some(deliberation) = self.deliberation.as_ref() {
            let contract = (load.epoch, load.number);
            deliberation.planner().loaded(timeline, contract);
        }
    }

    /// What has become of a contract that a former life of the agent had loaded.
    pub(super) fn hear_late(
        &self,
        timeline: TimelineId,
        contract: ContractKey,
        outputs: &[Option<RegisterValue>],
        end: &ContractEnd,
    ) {
        let Some(deliberation) = self.deliberation.as_ref() else {
            return;
        };
        let late = match (end, outputs.first()) {
            (ContractEnd::Refused { .. }, _) => Late::NeverBegun,
            (_, Some(Some(RegisterValue::Symbol(name)))) => Late::Ended(name),
            _ => Late::Faulted,
        };
        deliberation.planner().late(timeline, contract, late);
    }

    /// Lets deliberation go on for so many operations, any number with none; how many it took.
    pub fn deliberate(&mut self, operations: Option<u64>) -> u64 {
        let job = self.deliberation.as_mut().and_then(|all| all.job.as_mut());
        let Some(job) = job else {
            return 0;
        };
        let done = operations.map_or(job.left, |most| most.min(job.left));
        job.left -= done;
        done
    }

    /// Takes the plan of work that is done, or says that it is stale.
    pub(super) fn finish_deliberation(&mut self, cycle: &mut Cycle) {
        let Some(deliberation) = &mut self.deliberation else {
            return;
        };
        let Some(job) = deliberation.job.take_if(|job| job.left == 0) else {
            return;
        };
        let Job {
            contract,
            snapshot,
            work,
            ..
        } = job;
        cycle.remarks.extend(work.remarks);
        let stale = work.reads.iter().find_map(|&timeline| {
            let now = self
                .service
                .present(timeline)
                .map(|present| present.contract);
            let then = snapshot.present[timeline]
                .as_ref()
                .map(|present| present.contract);
            (now != then).then(|| {
                let name = &self.service.model().timelines[timeline].name;
                format!("{name} says something else than when the plan was begun")
            })
        });
        let stale = stale.or_else(|| {
            let mut plan = work.plan?;
            // When a plan begins is a lower bound: if all that it relies on is still the case, it may
            // begin later than it was thought to, since deliberation took longer.
            let soonest = self.service.now() + 2;
            for step in &mut plan.steps {
                step.not_before = step.not_before.max(soonest);
            }
            let refused = self.service.commit(&snapshot, plan).err()?;
            Some(refused.to_string())
        });
        let model = self.service.model().clone();
        let outputs = match &stale {
            None => work.outputs,
            Some(why) => {
                cycle.remarks.push(format!("the plan is stale: {why}"));
                let planning = self.service.present(usize::from(contract.timeline));
                let planning = planning.filter(|present| present.contract == contract);
                planning.map_or_else(Vec::new, |present| {
                    wording::named_outputs(&model, present.predicate, "STALE")
                })
            }
        };
        if let Err(refusal) = self.service.bind(contract, &outputs, true) {
            cycle.faults.push(refusal.to_string());
        }
    }
}
