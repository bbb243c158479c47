//! Orders against brute force, and what becomes of goals that fail.

use farside::random::RandomKey;

use super::*;

/// What an order is worth: goals that must be done, weight, how many, and when it ends; none, if the
/// horizon or the battery does not allow it.
fn worth(
    order: &[usize],
    targets: &[Target],
    begin: &Begin,
    settings: &Settings,
) -> Option<(usize, u64, usize, std::cmp::Reverse<Ticks>)> {
    let (mut at, mut now, mut battery) = ([begin.x_dm, begin.y_dm], 0, begin.battery);
    let (mut must, mut weight) = (0, 0);
    for (place, &target) in order.iter().enumerate() {
        let target = &targets[target];
        let there = [target.x_dm, target.y_dm];
        let drive = drive_ticks(at, there, settings);
        // The rover is a tick at least where it begins.
        now += drive + settings.image_ticks + Ticks::from(place == 0);
        battery -= settings.drive_energy * drive + settings.image_energy;
        at = there;
        match target.weight {
            None => must += 1,
            Some(more) => weight += u64::from(more),
        }
    }
    let allowed = now <= settings.horizon && battery >= settings.reserve;
    allowed.then_some((must, weight, order.len(), std::cmp::Reverse(now)))
}

/// All orders of all selections that begin so.
fn all_orders(count: usize, begun: &mut Vec<usize>, look: &mut impl FnMut(&[usize])) {
    look(begun);
    for target in 0..count {
        if !begun.contains(&target) {
            begun.push(target);
            all_orders(count, begun, look);
            begun.pop();
        }
    }
}

fn random_targets(seed: u64, count: usize) -> (Vec<Target>, Begin, Settings) {
    let mut random = RandomKey::new(seed).text("targets").stream();
    let mut place = || random.below(400) as Value - 200;
    let places: Vec<[Value; 2]> = (0..=count).map(|_| [place(), place()]).collect();
    let targets = places[1..].iter().enumerate().map(|(number, at)| Target {
        number: number as Value,
        x_dm: at[0],
        y_dm: at[1],
        pan_deg: 0,
        tilt_deg: 0,
        camera: 0,
        weight: (number % 3 != 0).then(|| 1 + random.below(4) as u32),
    });
    let targets = targets.collect();
    let begin = Begin {
        x_dm: places[0][0],
        y_dm: places[0][1],
        battery: 25_000 + random.below(20_000) as Value,
    };
    let settings = Settings {
        horizon: 300 + random.below(2_000) as Ticks,
        ..Settings::default()
    };
    (targets, begin, settings)
}

fn check_against_brute_force(seed: u64, count: usize) -> Ordering {
    let (targets, begin, settings) = random_targets(seed, count);
    let found = order(&targets, &begin, &settings).expect("the numbers are right");
    assert!(
        found.proven,
        "seed {seed}, {count} goals: {}",
        found.operations
    );
    let mut best = None;
    all_orders(count, &mut Vec::new(), &mut |order| {
        best = best.max(worth(order, &targets, &begin, &settings));
    });
    let visits: Vec<usize> = found.visits.iter().map(|visit| visit.target).collect();
    assert_eq!(
        worth(&visits, &targets, &begin, &settings),
        best,
        "seed {seed}: {found:?}"
    );
    assert_eq!(found.visits.len() + found.left_out.len(), count);
    if let (Some(last), Some(best)) = (found.visits.last(), best) {
        assert_eq!(last.end, best.3.0, "seed {seed}: the planner's own time");
    }
    found
}

#[test]
fn few_goals_are_ordered_as_well_as_brute_force_does() {
    let mut partial = 0;
    for seed in 0..24 {
        let found = check_against_brute_force(seed, 1 + seed as usize % 4);
        partial += usize::from(!found.left_out.is_empty());
    }
    assert!(partial > 3, "some horizons and batteries are too small");
}

#[test]
fn what_is_the_same_twice_gives_the_same() {
    for count in [4, 16] {
        let (targets, begin, settings) = random_targets(3, count);

        let [one, other] = [0; 2].map(|_| order(&targets, &begin, &settings).expect("it is right"));
        assert_eq!(one, other);
    }
}

/// The figure of the docs: 120 problems of up to 6 goals.
#[test]
#[ignore = "as above, with more goals"]
fn six_goals_are_ordered_as_well_as_brute_force_does() {
    let most =
        (0..120).map(|seed| check_against_brute_force(seed, 1 + seed as usize % 6).operations);
    println!("at most {} operations", most.max().unwrap_or(0));
}

/// Follows a plan, each goal of which ends as `ends` says of its step.
fn followed(plan: &crate::service::Plan, mut ends: impl FnMut(usize) -> bool) -> Vec<Value> {
    let ok = crate::models::mission().statuses.ok;
    let (mut at, mut done) = (0, Vec::new());
    loop {
        let step = &plan.steps[at];
        done.push(step.inputs[0]);
        let is_done = ends(done.len());
        let mut branches = step.branches.iter();
        let next = branches.find(|branch| branch.when.is_none_or(|(_, is)| is_done && is == ok));
        match next {
            Some(next) => {
                assert!(next.next > at, "what follows is later in the list");
                at = next.next;
            }
            None => return done,
        }
    }
}

#[test]
fn a_plan_has_a_branch_for_each_goal_that_fails() {
    let target = |number: Value, x_dm| Target {
        number,
        x_dm,
        y_dm: 0,
        pan_deg: 0,
        tilt_deg: 0,
        camera: 0,
        weight: None,
    };
    let targets = [target(1, 300), target(2, 100), target(3, -150)];
    let begin = Begin {
        x_dm: 0,
        y_dm: 0,
        battery: 90_000,
    };
    for few in [6, 0] {
        let settings = Settings {
            few,
            ..Settings::default()
        };
        let mission = crate::models::mission();
        let found = deliberate(mission, &targets, &begin, 50, &settings).expect("it is right");
        let plan = found.plan.expect("there are goals");
        assert!(plan.steps.iter().all(|step| step.not_before == 50));
        let in_order = followed(&plan, |_| true);
        assert_eq!(in_order, [-150, 100, 300]);
        let failed = followed(&plan, |count| count != 1);
        assert_eq!(failed[0], -150);
        assert_eq!(failed[1..], [100, 300]);
        // All fail: each is tried once.
        let mut none = followed(&plan, |_| false);
        none.sort_unstable();
        assert_eq!(none, [-150, 100, 300]);
    }
}

#[test]
fn many_goals_are_ordered_by_repair() {
    let (targets, begin, settings) = random_targets(5, 10);
    let settings = Settings { few: 6, ..settings };
    let found = order(&targets, &begin, &settings).expect("it is right");
    assert!(!found.proven && !found.visits.is_empty());
    let visits: Vec<usize> = found.visits.iter().map(|visit| visit.target).collect();
    assert!(
        worth(&visits, &targets, &begin, &settings).is_some(),
        "{found:?}"
    );
    assert_eq!(found.visits.len() + found.left_out.len(), 10);
    assert!(found.left_out.iter().all(|one| !one.reason.is_empty()));
}

#[test]
fn mistakes_are_said() {
    let (targets, begin, settings) = random_targets(1, 2);
    let twice = [targets[0], targets[0]];
    let said = order(&twice, &begin, &settings).expect_err("a goal is there twice");
    assert_eq!(said.to_string(), "goal 0 is there twice");
    let empty = Begin {
        battery: -5,
        ..begin
    };
    let none = order(&targets, &empty, &settings).expect("nothing can be done");
    assert_eq!((none.visits.len(), none.left_out.len()), (0, 2));
    let wrong = Settings {
        image_ticks: -1,
        ..settings
    };
    assert!(order(&targets, &begin, &wrong).is_err());
}

/// Whatever goals fail, each is tried once: also where another order is better after a failure.
#[test]
fn after_any_failures_each_goal_is_tried_once() {
    let mut other_orders = 0;
    for seed in 0..20 {
        let (targets, begin, settings) = random_targets(seed, 5);
        let begin = Begin {
            battery: 100_000,
            ..begin
        };
        let settings = Settings {
            horizon: 50_000,
            ..settings
        };
        let mission = crate::models::mission();
        let found = deliberate(mission, &targets, &begin, 9, &settings).expect("it is right");
        let plan = found.plan.expect("there are goals");
        other_orders += usize::from(plan.steps.len() > 5);
        for fails in 0..32_usize {
            let mut tried = followed(&plan, |count| fails >> (count - 1) & 1 == 0);
            tried.sort_unstable();
            let mut all: Vec<Value> = targets.iter().map(|target| target.x_dm).collect();
            all.sort_unstable();
            assert_eq!(tried, all, "seed {seed}, failures {fails:b}");
        }
    }
    assert!(other_orders > 5, "{other_orders}");
}
