//! The scientists of the closed loop. That of a rover keeps, exchanges and learns, and commands nothing. That
//! at the centre's site does the same, and closes the loop: it asks the prioritiser what to look at next, and
//! tells all planners and centres. With elections it is that of whichever site has the centre: a centre that takes
//! office tells the scientist at its site, with the list that it knows, and so does one that leaves it.

use std::collections::BTreeMap;
use std::sync::Arc;

use farside::prelude::*;
use farside_actors::rover::CommandReport;

use super::costs::Cost;
use super::messages::{
    GoalList, GoalListHeld, GoalsAchieved, ListDue, LoopDue, LoopMade, OfficeHeld, WishesDue,
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

/// The scientist at a site that has the centre, or may come to have it.
pub(super) struct LeadScientist {
    shared: Arc<Shared>,
    site: u32,
    learner: Learner,
    /// Whether something was learnt since the prioritiser was asked last.
    has_learnt: bool,
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
    /// Whether the centre of this site is the centre now, with elections.
    leads: bool,
}

impl LeadScientist {
    pub(super) fn new(shared: Arc<Shared>, site: u32) -> LeadScientist {
        let number = match site == shared.site_of_centre() {
            true => shared.site.rovers.len() as u32,
            false => site,
        };
        let learner = Learner::new(shared.site.clone(), number, peers(&shared, number));
        let prioritiser = Prioritiser::new(PrioritiserSettings {
            rocks: shared.survey.rocks as usize,
            squares: shared.survey.squares as usize,
            ..PrioritiserSettings::default()
        });
        LeadScientist {
            held: shared.names.keys().map(|party| (*party, 0)).collect(),
            shared,
            site,
            learner,
            has_learnt: false,
            prioritiser,
            timer: None,
        }
    }

    /// Whether it closes the loop now.
    fn leads(&self, ctx: &mut Context<'_, Self>) -> bool {
        self.shared.settings.election.is_none() || ctx.durable::<Kept>().leads
    }

    /// Whether it shares its host with a party of the protocol.
    fn is_at_home(&self, party: Party) -> bool {
        let (Party::Owner(site) | Party::Centre(site)) = party;
        site == self.site
    }

    /// Learns, and records it.
    fn learn(&mut self, ctx: &mut Context<'_, Self>) {
        if let Some(model) = self.learner.learn(0) {
            ctx.sample(&model);
            self.has_learnt = true;
        }
    }

    /// Whether readings came since the prioritiser was asked last; asks it again if so, or if nobody knows
    /// anything yet.
    fn prioritise(&mut self, ctx: &mut Context<'_, Self>) -> bool {
        let site = self.shared.site.clone();
        self.learn(ctx);
        match (std::mem::take(&mut self.has_learnt), self.learner.lesson()) {
            (true, Some(lesson)) => {
                let objective = lesson.objective(&site);
                self.prioritiser.revise(lesson.learned(), objective);
                true
            }
            (_, None) => {
                if let Some(guess) = first_guess(&site) {
                    self.prioritiser.revise(&guess, Objective::Distribution);
                }
                false
            }
            (false, Some(_)) => false,
        }
    }

    /// Makes the list anew, and tells it if it differs.
    fn revise(&mut self, has_learnt: bool, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        let (wishes, scale): (&Wishes, f64) = (self.prioritiser.wishes(), self.shared.survey.scale);
        let can = |observation| Cost::of(observation, &self.shared.rover).is_some();
        let kept = ctx.durable::<Kept>();
        kept.loops += u32::from(has_learnt);
        let edition = kept.wishlist.list.edition;
        let edition = self.shared.next_edition(edition, self.site);
        let difference =
            kept.wishlist
                .revise(wishes, (scale, can), &self.shared.own, (now, edition));
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
        if !self.leads(ctx) {
            return Ok(());
        }
        let (now, list) = (ctx.now(), ctx.durable::<Kept>().wishlist.list.clone());
        let windows = &self.shared.settings.windows;
        let is_open = windows.is_open(now);
        let lacking = self.held.iter().filter(|(_, held)| **held < list.edition);
        let lacking: Vec<Party> = lacking.map(|(party, _)| *party).collect();
        for party in lacking
            .iter()
            .filter(|party| is_open || self.is_at_home(**party))
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

    /// Whether it is a rover's scientist, too.
    fn is_of_rover(&self) -> bool {
        self.site != self.shared.site_of_centre()
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
        OfficeHeld,
        CommandReport,
        LessonDue,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.learner.begin(ctx.incarnation());
        self.learner.schedule_exchange(ctx);
        ctx.timer(self.shared.survey.loop_every, LoopDue);
        self.schedule_own(ctx);
        if self.is_of_rover() {
            ctx.timer(self.shared.site.config.learn_every, LessonDue);
        }
        if ctx.incarnation() > 0 || !self.leads(ctx) {
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
        if self.leads(ctx) && self.prioritise(ctx) {
            self.revise(true, ctx)?;
        }
        Ok(())
    }
}

impl Handler<WishesDue> for LeadScientist {
    fn handle(&mut self, _: WishesDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.schedule_own(ctx);
        if !self.leads(ctx) {
            return Ok(());
        }
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
    fn handle(&mut self, held: GoalListHeld, ctx: &mut Context<'_, Self>) -> Outcome {
        let known = self.held.entry(held.from).or_default();
        *known = held.edition.max(*known);
        let kept = ctx.durable::<Kept>();
        if held.edition > kept.wishlist.list.edition && self.leads(ctx) {
            // Of a list that somebody made who is the centre no more: this one has to be newer.
            let kept = ctx.durable::<Kept>();
            kept.wishlist.list.edition = self.shared.next_edition(held.edition, self.site);
            let list = kept.wishlist.list.clone();
            ctx.sample(&list);
            return self.tell(ctx);
        }
        Ok(())
    }
}

impl Handler<GoalsAchieved> for LeadScientist {
    fn handle(&mut self, achieved: GoalsAchieved, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.durable::<Kept>().wishlist.achieve(&achieved.goals);
        Ok(())
    }
}

impl Handler<OfficeHeld> for LeadScientist {
    fn handle(&mut self, office: OfficeHeld, ctx: &mut Context<'_, Self>) -> Outcome {
        let kept = ctx.durable::<Kept>();
        kept.wishlist.take(office.list);
        let has_led = std::mem::replace(&mut kept.leads, office.holds);
        if has_led || !office.holds {
            return Ok(());
        }
        // Whoever had the list of another scientist is told this one.
        self.held.values_mut().for_each(|held| *held = 0);
        let has_learnt = self.prioritise(ctx);
        self.revise(has_learnt, ctx)?;
        self.tell(ctx)
    }
}

impl Handler<CommandReport> for LeadScientist {
    fn handle(&mut self, report: CommandReport, _: &mut Context<'_, Self>) -> Outcome {
        self.learner.keep(&report)
    }
}

impl Handler<LessonDue> for LeadScientist {
    fn handle(&mut self, _: LessonDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.learn(ctx);
        ctx.timer(self.shared.site.config.learn_every, LessonDue);
        Ok(())
    }
}
