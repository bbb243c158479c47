//! What a rover or a centre did in a survey and what it waited for, from what rovers recorded of their plans.

use std::collections::BTreeSet;

use farside::{SimDuration, SimTime};
use farside_actors::rover::hardware_name;
use farside_actors::system::{Account, Doing, Phase, PictureError, Recording, Setup};

use super::activities::named;
use super::history::{Carried, Cast, History, News, RoverHistory};
use crate::assemble::names;
use crate::shac::{Party, Reason};
use crate::survey::messages::{Activity, ActivityEnd, PlanMade, PlannedActivity};
use crate::survey::scenario::SurveyScenario;

/// As many goals as are named that a plan has no room for.
const UNMET: usize = 3;

/// A wait as long as this in which no centre is heard is told to be one.
const SILENCE_NS: u64 = 600_000_000_000;

/// The account of an actor up to a time; none if it is neither of a rover nor a centre. On a rover's host its
/// planner, its scientist and its hardware have one account.
pub(in crate::survey) fn account(
    scenario: &SurveyScenario,
    actor: &str,
    run: &dyn Recording,
    until_ns: Option<u64>,
    setup: &mut Setup<'_>,
) -> Result<Option<Account>, PictureError> {
    let settings = scenario.settings(setup.files)?;
    let (rovers, parties) = (names(&scenario.team), scenario.parties(&settings));
    let history = History::read(run, Cast::new(rovers.clone(), &parties))?;
    let until_ns = until_ns.map_or(history.end_ns, |until| until.min(history.end_ns));
    let party = parties.iter().find(|(_, name)| *name == actor);
    let rover = match party.map(|(party, _)| *party) {
        Some(Party::Owner(rover)) => Some(rover as usize),
        Some(Party::Centre(site)) => return Ok(Some(of_centre(&history, site, until_ns))),
        None => rovers
            .iter()
            .position(|name| name == actor || hardware_name(name) == actor),
    };
    let centre = parties
        .iter()
        .find(|(party, _)| matches!(party, Party::Centre(_)))
        .map_or("centre", |(_, name)| name);
    Ok(rover.map(|rover| {
        let told = Told {
            history: &history,
            rover: &history.rovers[rover],
            centre,
            until_ns,
        };
        told.account()
    }))
}

/// A centre shares goals out as long as it is up.
fn of_centre(history: &History, site: u32, until_ns: u64) -> Account {
    let mut account = Account::default();
    account.push(Phase {
        from_ns: 0,
        until_ns,
        doing: Doing::Active,
        text: "shares goals out".to_owned(),
        waits_for: Vec::new(),
    });
    let spans = history
        .centres
        .get(&site)
        .map(|outages| &outages.spans_ns[..]);
    account.with_outages(spans.unwrap_or_default().iter().copied(), until_ns)
}

/// A rover, as far as it is told.
struct Told<'h> {
    history: &'h History,
    rover: &'h RoverHistory,
    /// The centre that it is in touch with first.
    centre: &'h str,
    until_ns: u64,
}

impl Told<'_> {
    fn account(&self) -> Account {
        let mut account = Account::default();
        let mut at_ns = 0;
        for carried in &self.rover.carried {
            let began_ns = carried.began_ns.clamp(at_ns, self.until_ns.max(at_ns));
            self.wait((at_ns, began_ns.min(self.until_ns)), &mut account);
            let ended_ns = self.rover.ended_ns(carried, self.until_ns);
            let ended_ns = ended_ns.clamp(began_ns, self.until_ns.max(began_ns));
            account.push(self.carried(carried, (began_ns, ended_ns)));
            at_ns = ended_ns;
        }
        self.wait((at_ns, self.until_ns), &mut account);
        let spans = self.rover.outages.spans_ns.iter().copied();
        account.with_outages(spans, self.until_ns)
    }

    /// Something that was planned is done.
    fn carried(&self, carried: &Carried, (from_ns, until_ns): (u64, u64)) -> Phase {
        let (doing, mut text) = match carried.planned.activity {
            Activity::Drive(goal) => (Doing::Active, format!("drives to {}", named(&goal))),
            Activity::Goal(goal) => (Doing::Active, format!("takes {}", named(&goal))),
            Activity::Communication(sol) => {
                (Doing::Active, format!("communicates, sol {}", sol + 1))
            }
            Activity::Sleep => (Doing::Waiting, "sleeps, there is no light".to_owned()),
        };
        // What had not ended by then has no end yet.
        let end = carried
            .ended
            .filter(|(ended_ns, _)| *ended_ns <= self.until_ns);
        match end {
            Some((_, ActivityEnd::Interrupted(why))) => {
                text.push_str(&format!(": broken off, {}", reason(why)));
            }
            Some((_, ActivityEnd::Failed(why))) => {
                text.push_str(&format!(": failed, {}", reason(why)));
            }
            Some((_, ActivityEnd::Done)) | None => {}
        }
        for (at_ns, fault) in &self.rover.faults {
            if (from_ns..until_ns).contains(at_ns) {
                let at = SimDuration::from_nanos(*at_ns);
                text.push_str(&format!("; {} at {at}", fault.replace('-', " ")));
            }
        }
        Phase {
            from_ns,
            until_ns,
            doing,
            text,
            waits_for: Vec::new(),
        }
    }

    /// Nothing is done: what for depends on the plan in force.
    fn wait(&self, (from_ns, until_ns): (u64, u64), account: &mut Account) {
        if from_ns >= until_ns {
            return;
        }
        let plans = self.rover.plans.iter().map(|(time_ns, _)| *time_ns);
        let ups = self.rover.outages.spans_ns.iter();
        let ups = ups.filter_map(|(_, up_ns)| *up_ns);
        let instants = plans.chain(ups).chain(self.first_list());
        let mut instants: BTreeSet<u64> = instants
            .filter(|time_ns| (from_ns..until_ns).contains(time_ns))
            .collect();
        instants.insert(from_ns);
        let instants: Vec<u64> = instants.into_iter().collect();
        for (at, from_ns) in instants.iter().enumerate() {
            let until_ns = instants.get(at + 1).map_or(until_ns, |next| *next);
            account.push(self.waiting((*from_ns, until_ns)));
        }
    }

    /// When the first list of goals was made.
    fn first_list(&self) -> Option<u64> {
        let mut lists = self.history.news.iter();
        let first = lists.find(|(_, news)| matches!(news, News::List(_)));
        first.map(|(time_ns, _)| *time_ns)
    }

    fn waiting(&self, (from_ns, until_ns): (u64, u64)) -> Phase {
        let made = self
            .rover
            .plans
            .partition_point(|(time_ns, _)| *time_ns <= from_ns);
        let plan = made.checked_sub(1).map(|last| &self.rover.plans[last].1);
        let ahead = plan.and_then(|plan| self.ahead(plan, from_ns));
        let (doing, mut text, for_centre) = match (plan, ahead) {
            (None, _) => {
                let is_listed = self
                    .first_list()
                    .is_some_and(|first_ns| first_ns <= from_ns);
                let what = match is_listed {
                    true => "waits for its first plan",
                    false => "waits for a list of goals, and for a plan",
                };
                (Doing::Waiting, what.to_owned(), true)
            }
            (Some(plan), Some(next)) => {
                let starts = next.starts.since(SimTime::ZERO);
                let text = format!("waits for {} at {starts}", what(&next.activity));
                (Doing::Waiting, text + &self.short_of(plan, from_ns), false)
            }
            (Some(plan), None) if self.is_over(plan) => {
                (Doing::Done, "has no goal left".to_owned(), false)
            }
            (Some(plan), None) => {
                let text = "has nothing planned, waits for goals".to_owned();
                (Doing::Waiting, text + &unmet(plan), true)
            }
        };
        if doing == Doing::Waiting && until_ns - from_ns >= SILENCE_NS {
            let heard = self
                .rover
                .hears_ns
                .partition_point(|time_ns| *time_ns < until_ns);
            let last_ns = heard.checked_sub(1).map(|last| self.rover.hears_ns[last]);
            if last_ns.is_none_or(|last_ns| last_ns < from_ns) {
                let since = last_ns.map_or("never".to_owned(), |last_ns| {
                    format!("last at {}", SimDuration::from_nanos(last_ns))
                });
                text.push_str(&format!("; hears no centre meanwhile, {since}"));
            }
        }
        Phase {
            from_ns,
            until_ns,
            doing,
            text,
            waits_for: match for_centre {
                true => vec![self.centre.to_owned()],
                false => Vec::new(),
            },
        }
    }

    /// What of a plan comes next.
    fn ahead<'p>(&self, plan: &'p PlanMade, time_ns: u64) -> Option<&'p PlannedActivity> {
        let begun = self.rover.carried.iter();
        let begun = begun.filter(|carried| carried.began_ns < time_ns);
        let begun: BTreeSet<Activity> = begun
            .filter(|carried| {
                carried
                    .ended
                    .is_some_and(|(_, end)| end == ActivityEnd::Done)
            })
            .map(|carried| carried.planned.activity)
            .collect();
        let is_sleep = |activity: &PlannedActivity| activity.activity == Activity::Sleep;
        let mut ahead = plan.activities.iter().filter(|activity| {
            let is_over = activity.ends.since(SimTime::ZERO).as_nanos() <= time_ns;
            // Every night has a sleep of the same name.
            !is_over && (is_sleep(activity) || !begun.contains(&activity.activity))
        });
        ahead.next()
    }

    /// Whether the rover does no goal any more: neither later nor for want of something.
    fn is_over(&self, plan: &PlanMade) -> bool {
        let last = self.rover.plans.last();
        last.is_some_and(|(_, last)| last.number == plan.number) && plan.unmet.is_empty()
    }

    /// What a plan waits for: charge, if there is less than it keeps.
    fn short_of(&self, plan: &PlanMade, time_ns: u64) -> String {
        let level = self.rover.level_at(time_ns);
        match level.filter(|level| level.battery_j < plan.reserve_j) {
            Some(level) => format!(
                "; its battery holds {:.0} J, and {:.0} J are to stay in it",
                level.battery_j, plan.reserve_j
            ),
            None => unmet(plan),
        }
    }
}

/// What is waited for.
fn what(activity: &Activity) -> String {
    match activity {
        Activity::Drive(goal) => format!("the drive to {}", named(goal)),
        Activity::Goal(goal) => named(goal),
        Activity::Communication(_) => "the daily communication".to_owned(),
        Activity::Sleep => "its sleep".to_owned(),
    }
}

/// Goals that a plan should have and has not.
fn unmet(plan: &PlanMade) -> String {
    let shown = plan.unmet.iter().take(UNMET);
    let shown: Vec<String> = shown
        .map(|unmet| format!("{} ({})", named(&unmet.goal), reason(unmet.reason)))
        .collect();
    let more = plan.unmet.len().saturating_sub(UNMET);
    let more = match more {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    match shown.is_empty() {
        true => String::new(),
        false => format!("; has no room for {}{more}", shown.join(", ")),
    }
}

/// Why something was not done.
fn reason(reason: Reason) -> &'static str {
    match reason {
        Reason::Time => "no time is left",
        Reason::Power => "there is too little power",
        Reason::Memory => "there is too little memory",
        Reason::Path => "there is no way",
        Reason::Worth => "it is worth too little",
        Reason::Hardware => "the hardware failed",
        Reason::LeaseEnded => "its lease has ended",
        Reason::Achieved => "another rover has done it",
        Reason::Withdrawn => "it is no longer wished for",
        Reason::RefusedByAll => "all rovers have refused it",
        Reason::Revoked => "the centre took it back",
        Reason::Declared => "the centre gave it up",
        Reason::Partner => "the other rover did not come",
    }
}
