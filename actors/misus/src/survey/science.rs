//! The scientists of the closed loop. That of a rover keeps, exchanges and learns, and commands nothing. That
//! at the centre's site does the same, and closes the loop: it asks the prioritiser what to look at next, and
//! tells all planners and centres.

use std::collections::BTreeMap;
use std::sync::Arc;

use farside::prelude::*;
use farside_actors::rover::CommandReport;

use super::costs::Cost;
use super::messages::{
    GoalList, GoalListHeld, GoalsAchieved, ListDue, LoopDue, LoopMade, WishesDue,
};
use super::shared::{SCIENTIST, Shared};
use super::wishlist::Wishlist;
use crate::analysis::exchange::Statistics;
use crate::analysis::goals::Wishes;
use crate::analysis::objective::Objective;
use crate::analysis::prioritise::{Prioritiser, PrioritiserSettings};
use crate::learner::Learner;
use crate::learning::first_guess;
use crate::messages::{ExchangeDue, LessonDue};
use crate::shac::Party;

/// How long after the list was sent it is sent again to who has not said that it has it.
const LIST_AGAIN: SimDuration = SimDuration::from_secs(60);

/// All scientists but one, by number and name: those of rovers, and that at the centre's site.
fn peers(shared: &Shared, but: u32) -> Vec<(u32, String)> {
    let names = shared.site.rovers.iter().cloned();
    let all = (0..).zip(names.chain([SCIENTIST.to_owned()]));
    all.filter(|(number, _)| *number != but).collect()
}

/// Tells the others what they may lack, if there is contact, and goes on.
fn exchange<A: Handler<ExchangeDue>>(
    shared: &Shared,
    learner: &mut Learner,
    ctx: &mut Context<'_, A>,
) -> Outcome {
    let now = ctx.now();
    if shared.site.is_in_contact(now) && shared.settings.windows.is_open(now) {
        learner.exchange(ctx)?;
    }
    learner.schedule_exchange(ctx);
    Ok(())
}

/// A rover's scientist.
pub(super) struct FieldScientist {
    shared: Arc<Shared>,
    learner: Learner,
}

impl FieldScientist {
    pub(super) fn new(shared: Arc<Shared>, number: u32) -> FieldScientist {
        let learner = Learner::new(shared.site.clone(), number, peers(&shared, number));
        FieldScientist { shared, learner }
    }
}

impl Actor for FieldScientist {
    type Accepts = (ExchangeDue, LessonDue, CommandReport, Statistics);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.learner.begin(ctx.incarnation());
        self.learner.schedule_exchange(ctx);
        ctx.timer(self.shared.site.config.learn_every, LessonDue);
        Ok(())
    }
}

impl Handler<ExchangeDue> for FieldScientist {
    fn handle(&mut self, _: ExchangeDue, ctx: &mut Context<'_, Self>) -> Outcome {
        exchange(&self.shared, &mut self.learner, ctx)
    }
}

impl Handler<LessonDue> for FieldScientist {
    fn handle(&mut self, _: LessonDue, ctx: &mut Context<'_, Self>) -> Outcome {
        if let Some(model) = self.learner.learn(0) {
            ctx.sample(&model);
        }
        ctx.timer(self.shared.site.config.learn_every, LessonDue);
        Ok(())
    }
}

impl Handler<CommandReport> for FieldScientist {
    fn handle(&mut self, report: CommandReport, _: &mut Context<'_, Self>) -> Outcome {
        self.learner.keep(&report)
    }
}

impl Handler<Statistics> for FieldScientist {
    fn handle(&mut self, statistics: Statistics, _: &mut Context<'_, Self>) -> Outcome {
        self.learner.hear(&statistics);
        Ok(())
    }
}

/// The scientist at the centre's site.
pub(super) struct LeadScientist {
    shared: Arc<Shared>,
    learner: Learner,
    prioritiser: Prioritiser,
    /// The edition of the list that each planner and centre is known to have.
    held: BTreeMap<Party, u64>,
    timer: Option<TimerId>,
}

/// What it keeps through crashes.
#[derive(Default)]
struct Kept {
    wishlist: Wishlist,
    loops: u32,
}

impl LeadScientist {
    pub(super) fn new(shared: Arc<Shared>) -> LeadScientist {
        let number = shared.site.rovers.len() as u32;
        let learner = Learner::new(shared.site.clone(), number, peers(&shared, number));
        let prioritiser = Prioritiser::new(PrioritiserSettings {
            rocks: shared.survey.rocks as usize,
            squares: shared.survey.squares as usize,
            ..PrioritiserSettings::default()
        });
        LeadScientist {
            held: shared.names.keys().map(|party| (*party, 0)).collect(),
            shared,
            learner,
            prioritiser,
            timer: None,
        }
    }

    /// Whether readings came since the prioritiser was asked last; asks it again if so, or if nobody knows
    /// anything yet.
    fn prioritise(&mut self, ctx: &mut Context<'_, Self>) -> bool {
        let site = self.shared.site.clone();
        match (self.learner.learn(0), self.learner.lesson()) {
            (Some(model), Some(lesson)) => {
                let objective = lesson.objective(&site);
                self.prioritiser.revise(lesson.learned(), objective);
                ctx.sample(&model);
                true
            }
            (_, None) => {
                if let Some(guess) = first_guess(&site) {
                    self.prioritiser.revise(&guess, Objective::Distribution);
                }
                false
            }
            (None, Some(_)) => false,
        }
    }

    /// Makes the list anew, and tells it if it differs.
    fn revise(&mut self, has_learnt: bool, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        let (wishes, scale): (&Wishes, f64) = (self.prioritiser.wishes(), self.shared.survey.scale);
        let can = |observation| Cost::of(observation, &self.shared.rover).is_some();
        let kept = ctx.durable::<Kept>();
        kept.loops += u32::from(has_learnt);
        let difference = kept
            .wishlist
            .revise(wishes, (scale, can), &self.shared.own, now);
        let made = LoopMade {
            loops: kept.loops,
            readings: self.learner.readings() as u32,
            edition: kept.wishlist.list.edition,
            added: difference.map_or(0, |one| one.added),
            changed: difference.map_or(0, |one| one.changed),
            withdrawn: difference.map_or(0, |one| one.withdrawn),
        };
        let list = kept.wishlist.list.clone();
        if has_learnt || difference.is_some() {
            ctx.sample(&made);
        }
        if difference.is_some() {
            ctx.sample(&list);
            self.tell(ctx)?;
        }
        Ok(())
    }

    /// Sends the list to all who are not known to have it, as far as anything may be sent.
    fn tell(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        if let Some(timer) = self.timer.take() {
            ctx.cancel(timer);
        }
        let (now, list) = (ctx.now(), ctx.durable::<Kept>().wishlist.list.clone());
        let windows = &self.shared.settings.windows;
        let is_open = windows.is_open(now);
        let lacking = self.held.iter().filter(|(_, held)| **held < list.edition);
        let lacking: Vec<Party> = lacking.map(|(party, _)| *party).collect();
        for party in lacking
            .iter()
            .filter(|party| is_open || self.shared.is_at_site(**party))
        {
            let recipient = ctx.recipient::<GoalList>(&self.shared.names[party])?;
            ctx.send(recipient, list.clone());
        }
        if !lacking.is_empty()
            && let Some(next) = windows.next_open(now + LIST_AGAIN)
        {
            self.timer = Some(ctx.timer(next.since(now), ListDue));
        }
        Ok(())
    }

    fn schedule_own(&self, ctx: &mut Context<'_, Self>) {
        if let Some(next) = self.shared.own.next_change(ctx.now()) {
            ctx.timer(next.since(ctx.now()), WishesDue);
        }
    }
}

impl Actor for LeadScientist {
    type Accepts = (
        ExchangeDue,
        Statistics,
        LoopDue,
        WishesDue,
        ListDue,
        GoalListHeld,
        GoalsAchieved,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.learner.begin(ctx.incarnation());
        self.learner.schedule_exchange(ctx);
        ctx.timer(self.shared.survey.loop_every, LoopDue);
        self.schedule_own(ctx);
        if ctx.incarnation() > 0 {
            // What is wished for is made anew when the others have told what was read.
            return self.tell(ctx);
        }
        self.prioritise(ctx);
        self.revise(false, ctx)
    }
}

impl Handler<ExchangeDue> for LeadScientist {
    fn handle(&mut self, _: ExchangeDue, ctx: &mut Context<'_, Self>) -> Outcome {
        exchange(&self.shared, &mut self.learner, ctx)
    }
}

impl Handler<Statistics> for LeadScientist {
    fn handle(&mut self, statistics: Statistics, _: &mut Context<'_, Self>) -> Outcome {
        self.learner.hear(&statistics);
        Ok(())
    }
}

impl Handler<LoopDue> for LeadScientist {
    fn handle(&mut self, _: LoopDue, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(self.shared.survey.loop_every, LoopDue);
        if self.prioritise(ctx) {
            self.revise(true, ctx)?;
        }
        Ok(())
    }
}

impl Handler<WishesDue> for LeadScientist {
    fn handle(&mut self, _: WishesDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.schedule_own(ctx);
        if self.prioritiser.wishes().goals.is_empty() {
            self.prioritise(ctx);
        }
        self.revise(false, ctx)
    }
}

impl Handler<ListDue> for LeadScientist {
    fn handle(&mut self, _: ListDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.timer = None;
        self.tell(ctx)
    }
}

impl Handler<GoalListHeld> for LeadScientist {
    fn handle(&mut self, held: GoalListHeld, _: &mut Context<'_, Self>) -> Outcome {
        let known = self.held.entry(held.from).or_default();
        *known = held.edition.max(*known);
        Ok(())
    }
}

impl Handler<GoalsAchieved> for LeadScientist {
    fn handle(&mut self, achieved: GoalsAchieved, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.durable::<Kept>().wishlist.achieve(&achieved.goals);
        Ok(())
    }
}
