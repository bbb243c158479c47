//! Whether mandatory goals can all be met: what there is too little of for which of them, before a run begins.
//!
//! What is refused here cannot be met whatever rovers do: they are taken to drive straight, to share the work
//! evenly and to lose no time. What fits by this and not in a run is said by the plans of that run
//! ([`PlanMade`](crate::survey::PlanMade)).

use farside::{SimDuration, SimTime};
use farside_actors::system::SetupError;
use farside_worlds::Sky;
use farside_worlds::sky::SOL_S;

use super::SurveyScenario;
use super::own_goals::wrong;
use crate::assemble::start;
use crate::survey::costs::Cost;
use crate::survey::outlook::Forecast;

/// How far apart the Sun is looked at.
const STEP: SimDuration = SimDuration::from_secs(300);

/// A mandatory goal.
struct Goal {
    /// Its number.
    at: usize,
    opens: SimDuration,
    closes: SimDuration,
    cost: Cost,
    /// How far it is from the start of the nearest rover \[m\]; none if that is known with the field only.
    away_m: f64,
}

/// What rovers have of something for what they must do, and what that takes.
struct Balance {
    takes: f64,
    has: f64,
    /// With both filled in.
    said: String,
}

/// Checks all of them, of a run until then if that is known: goals that have no window of their own are to be
/// met by its end.
pub(super) fn check(
    scenario: &SurveyScenario,
    until: Option<SimDuration>,
) -> Result<(), SetupError> {
    let goals = mandatory(scenario, until);
    if goals.is_empty() {
        return Ok(());
    }
    let sky = sky(scenario)?;
    for goal in &goals {
        check_alone(scenario, &sky, goal)?;
    }
    let mut seen = Vec::new();
    for from in goals.iter().map(|goal| goal.opens) {
        for until in goals.iter().map(|goal| goal.closes) {
            if until > from && !seen.contains(&(from, until)) {
                seen.push((from, until));
                check_within(scenario, &sky, &goals, [from, until])?;
            }
        }
    }
    Ok(())
}

fn mandatory(scenario: &SurveyScenario, until: Option<SimDuration>) -> Vec<Goal> {
    let rovers = scenario.team.rovers;
    let goals = scenario.goals.iter().enumerate();
    let mandatory = goals.filter_map(|(at, goal)| {
        let closes = match (goal.closes, until) {
            (Some(closes), Some(until)) => closes.min(until),
            (closes, until) => closes.or(until)?,
        };
        let starts = (0..rovers).map(|rover| start(rover, rovers));
        let away =
            starts.map(|from| libm::hypot(goal.east_m - from.east_m, goal.north_m - from.north_m));
        Some(Goal {
            at,
            opens: goal.opens.unwrap_or_default().max(goal.added),
            closes,
            cost: Cost::of(goal.observation, &scenario.rover)?,
            away_m: match goal.rock {
                Some(_) => 0.0,
                None => away.fold(f64::INFINITY, f64::min),
            },
        })
    });
    let is_mandatory = |goal: &Goal| scenario.goals[goal.at].mandatory;
    mandatory.filter(is_mandatory).collect()
}

/// Whether the nearest rover can be there in time, in the light.
fn check_alone(scenario: &SurveyScenario, sky: &Sky, goal: &Goal) -> Result<(), SetupError> {
    let (lasts, closes) = (goal.cost.duration, goal.closes);
    let drive = SimDuration::from_secs_f64(goal.away_m / scenario.rover.speed_m_per_s);
    let light = light(scenario, sky, SimDuration::ZERO, closes);
    if drive + lasts <= light {
        return Ok(());
    }
    let name = &scenario.goals[goal.at].name;
    let message = format!(
        "mandatory goal {name:?} cannot be met for want of time: the drive takes {drive} and the observation \
         {lasts}, and until {closes} there are {light} of light"
    );
    Err(wrong(goal.at, "mandatory", message))
}

/// Whether goals whose windows lie within a stretch of time fit into what all rovers have in it.
fn check_within(
    scenario: &SurveyScenario,
    sky: &Sky,
    goals: &[Goal],
    [from, until]: [SimDuration; 2],
) -> Result<(), SetupError> {
    let within = goals
        .iter()
        .filter(|goal| goal.opens >= from && goal.closes <= until);
    let within: Vec<&Goal> = within.collect();
    let Some(last) = within.last() else {
        return Ok(());
    };
    let rovers = scenario.team.rovers;
    let balances = [
        time(scenario, sky, &within, [from, until]),
        energy(scenario, sky, &within, [from, until]),
        memory(scenario, &within, [from, until]),
    ];
    if let Some(short) = balances.iter().find(|one| one.takes > one.has) {
        let names = within
            .iter()
            .map(|goal| scenario.goals[goal.at].name.as_str());
        let names: Vec<&str> = names.collect();
        let said = short.said.replace("{rovers}", &rovers.to_string());
        let message = format!(
            "mandatory goals cannot all be met: {} {said}",
            names.join(", ")
        );
        return Err(wrong(last.at, "mandatory", message));
    }
    Ok(())
}

fn time(
    scenario: &SurveyScenario,
    sky: &Sky,
    goals: &[&Goal],
    [from, until]: [SimDuration; 2],
) -> Balance {
    let takes = goals.iter().map(|goal| goal.cost.duration);
    let takes = takes.fold(SimDuration::ZERO, |sum, takes| sum + takes);
    let has = light(scenario, sky, from, until) * u64::from(scenario.team.rovers);
    Balance {
        takes: takes.as_secs_f64(),
        has: has.as_secs_f64(),
        said: format!(
            "take {takes} between {from} and {until}, where {{rovers}} rovers have {has} of light"
        ),
    }
}

/// What is beyond what the body takes: what batteries have above their reserve, and all that the Sun gives.
fn energy(
    scenario: &SurveyScenario,
    sky: &Sky,
    goals: &[&Goal],
    [from, until]: [SimDuration; 2],
) -> Balance {
    let rover = &scenario.rover;
    let beyond_j = |goal: &&Goal| {
        (goal.cost.power_w - rover.awake_power_w).max(0.0) * goal.cost.duration.as_secs_f64()
    };
    let takes_j: f64 = goals.iter().map(beyond_j).sum();
    let mut forecast = Forecast::new(
        *sky,
        scenario.world.starts.as_secs_f64(),
        rover,
        scenario.learn.sun_least_rad,
        scenario.execution.sun_share,
    );
    let ms = |at: SimDuration| (at.as_nanos() / 1_000_000) as i64;
    let step_ms = ms(STEP);
    // Days are alike: what is not found in some sols is not needed either.
    let until_ms = ms(until).min(ms(from) + (20e3 * SOL_S) as i64);
    let steps = (ms(from)..until_ms).step_by(step_ms as usize);
    let gains = steps.map(|at_ms| {
        forecast
            .gain_j(at_ms, (at_ms + step_ms).min(until_ms), 1.0)
            .max(0.0)
    });
    let gains_j: f64 = gains.sum();
    let full = if from.is_zero() { rover.charge } else { 1.0 };
    let charge_j = (full - scenario.learn.reserve).max(0.0) * rover.battery_j;
    let has_j = f64::from(scenario.team.rovers) * (charge_j + gains_j);
    Balance {
        takes: takes_j,
        has: has_j,
        said: format!(
            "take {takes_j:.0} J beyond what rovers' bodies take between {from} and {until}, where {{rovers}} \
             rovers have {has_j:.0} J above their reserve"
        ),
    }
}

/// What rovers can store, and send home meanwhile.
fn memory(scenario: &SurveyScenario, goals: &[&Goal], [from, until]: [SimDuration; 2]) -> Balance {
    let (rover, execution) = (&scenario.rover, &scenario.execution);
    let takes: f64 = goals.iter().map(|goal| goal.cost.memory_bits as f64).sum();
    let length_s = until.saturating_sub(from).as_secs_f64();
    let communications = libm::floor(length_s / SOL_S) + 1.0;
    let sends = rover.radio_bit_per_s as f64 * execution.communication.as_secs_f64();
    let has = f64::from(scenario.team.rovers)
        * (8.0 * rover.memory_bytes as f64 + communications * sends);
    Balance {
        takes,
        has,
        said: format!(
            "store {takes} bit between {from} and {until}, where {{rovers}} rovers can store and send home \
             {has} bit"
        ),
    }
}

fn sky(scenario: &SurveyScenario) -> Result<Sky, SetupError> {
    let world = &scenario.world;
    let sky = Sky::new(
        world.latitude_rad.to_degrees(),
        world.season_rad.to_degrees(),
        world.dust,
    );
    sky.map_err(|error| SetupError::value("world", error))
}

/// For how long it is light enough to work within a stretch of time.
fn light(
    scenario: &SurveyScenario,
    sky: &Sky,
    from: SimDuration,
    until: SimDuration,
) -> SimDuration {
    let least_deg = scenario.learn.sun_least_rad.to_degrees();
    // Days are alike: what is beyond some sols is as it is within them.
    let length = until.saturating_sub(from);
    let sols = (length.as_secs_f64() / SOL_S) as u64;
    let sol = SimDuration::from_nanos((SOL_S * 1e9) as u64);
    let lit = |length: SimDuration| {
        let steps = length.as_nanos().div_ceil(STEP.as_nanos());
        let lit = (0..steps).filter(|step| {
            let at_s = scenario.world.starts.as_secs_f64();
            let at_s = at_s + (SimTime::ZERO + from + STEP * *step).as_secs_f64();
            sky.elevation_deg(at_s) >= least_deg
        });
        STEP * lit.count() as u64
    };
    let rest = SimDuration::from_nanos(length.as_nanos().saturating_sub((sol * sols).as_nanos()));
    let whole = match sols {
        0 => SimDuration::ZERO,
        _ => lit(sol) * sols,
    };
    whole + lit(rest).min(rest)
}
