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
    for count in [4, 8] {
        let (targets, begin, settings) = random_targets(3, count);
        let settings = Settings {
            operations: 300_000,
            ..settings
        };
        let [one, other] = [0; 2].map(|_| order(&targets, &begin, &settings).expect("it is right"));
        assert_eq!(one, other);
    }
}
