//! Processors beside an integration in steps of a nanosecond.

use proptest::prelude::*;

use super::*;

fn at(ns: u64) -> SimTime {
    SimTime::from_nanos(ns)
}

fn times(factor: f64) -> Slowdown {
    Slowdown::new(factor).unwrap()
}

#[test]
fn the_longest_time_is_a_time() {
    let slow = Processor::new(Speed::PerS(1)).then(at(5), times(1e9));
    assert_eq!(slow.time_for(at(0), u64::MAX).as_nanos(), LONGEST_NS);
    let stopped = Processor::new(Speed::PerS(0));
    assert_eq!(stopped.time_for(at(0), 2), SimDuration::from_secs(2));
    let fast = Processor::new(Speed::PerS(u64::MAX)).then(at(0), times(1e-6));
    let long = SimDuration::from_nanos(u64::MAX);
    assert_eq!(fast.operations_in(at(0), long), Some(u64::MAX));
    assert_eq!(fast.time_for(at(0), u64::MAX).as_nanos(), 1000);
}

#[test]
fn factors_are_read_with_their_range() {
    for bad in ["0", "-1", "0.0", "nan", "inf", "-inf", "1e-9", "1e10"] {
        let read = toml::from_str::<toml::Table>(&format!("slowdown = {bad}")).unwrap();
        let error = Slowdown::deserialize(read["slowdown"].clone()).unwrap_err();
        assert!(
            error.to_string().contains("expected a factor above 0"),
            "{bad}: {error}"
        );
    }
    for good in ["50", "2.5", "0.000001", "1000000000"] {
        let read = toml::from_str::<toml::Table>(&format!("slowdown = {good}")).unwrap();
        let slowdown = Slowdown::deserialize(read["slowdown"].clone()).unwrap();
        let written = toml::Value::try_from(slowdown).unwrap();
        assert_eq!(Slowdown::deserialize(written).unwrap(), slowdown);
    }
    assert_eq!(
        toml::Value::try_from(times(50.0)).unwrap().to_string(),
        "50"
    );
}

/// A multiple of all whole numbers up to 20: a speed so often a second divides by each.
const DIVISIBLE: u64 = 232_792_560;

proptest! {
    #[test]
    fn work_takes_what_adding_it_up_nanosecond_by_nanosecond_gives(
        speed in 1u64..20,
        changes in prop::collection::vec((0u64..300, 1u64..=20), 0..8),
        from in 0u64..400,
        operations in 0u64..400,
    ) {
        let speed = speed * DIVISIBLE;
        let mut changes = changes;
        changes.sort_by_key(|change| change.0);
        changes.dedup_by_key(|change| change.0);
        let mut processor = Processor::new(Speed::PerS(speed));
        for (from, factor) in &changes {
            processor = processor.then(at(*from), times(*factor as f64));
        }
        // In billionths of an operation, of which a nanosecond has whole ones.
        let (mut done, mut ns) = (0, 0);
        while done < operations * 1_000_000_000 {
            let now = from + ns;
            let current = changes.iter().rev().find(|change| change.0 <= now);
            done += speed / current.map_or(1, |change| change.1);
            ns += 1;
        }
        prop_assert_eq!(processor.time_for(at(from), operations).as_nanos(), ns);
    }

    #[test]
    fn work_in_two_parts_never_takes_less_than_in_one(
        speed in 1u64..1_000_000_000,
        factor in 1e-6..1e9f64,
        begins in 0u64..2_000_000_000,
        parts in (0u64..100_000, 0u64..100_000),
    ) {
        let processor = Processor::new(Speed::PerS(speed)).then(at(begins), times(factor));
        let first = processor.time_for(at(0), parts.0);
        let second = processor.time_for(SimTime::ZERO + first, parts.1);
        let all = processor.time_for(at(0), parts.0 + parts.1);
        // Each part is rounded up.
        prop_assert!(first <= all && all <= first + second);
    }

    #[test]
    fn time_grows_with_work_and_is_never_too_short(
        speed in 1..u64::from(u32::MAX), operations in 0..u64::from(u32::MAX),
    ) {
        let processor = Processor::new(Speed::PerS(speed));
        let time = processor.time_for(at(7), operations);
        let done = u128::from(time.as_nanos()) * u128::from(speed);
        let asked = u128::from(operations) * 1_000_000_000;
        prop_assert!(done >= asked && done < asked + u128::from(speed));
        prop_assert!(processor.time_for(at(7), operations + 1) >= time);
        prop_assert!(processor.operations_in(at(7), time).unwrap() >= operations);
        if operations > 0 {
            let less = SimDuration::from_nanos(time.as_nanos() - 1);
            prop_assert!(processor.operations_in(at(7), less).unwrap() < operations);
        }
    }

    #[test]
    fn what_is_printed_parses_back(speed: u64) {
        let speed = Speed::PerS(speed);
        prop_assert_eq!(speed.to_string().parse::<Speed>(), Ok(speed));
    }
}
