//! Properties of plans and traces, held against slow and simple reckonings of the same.

use proptest::prelude::*;

use super::super::*;

/// Contacts of a few nodes, one after the other for each ordered pair.
fn plans() -> impl Strategy<Value = ContactPlan> {
    let gap = prop_oneof![Just(0u64), 1..5_000_000_000u64];
    let rate = prop_oneof![1..=MAX_RATE_BIT_PER_S, 1..100_000u64];
    let confidence = prop::option::of(0.001f64..1.0);
    let contact = (
        0u32..5,
        0u32..5,
        gap,
        1..9_000_000_000u64,
        rate,
        0..9_000_000_000u64,
        confidence,
    );
    prop::collection::vec(contact, 1..40).prop_map(|contacts| {
        let mut found = build::Found::default();
        let mut ends = std::collections::BTreeMap::new();
        for (line, (from, to, gap, length, rate, owlt, confidence)) in
            contacts.into_iter().enumerate()
        {
            let names = ["7", "10", "rover_1", "ipn:2.1", "9"];
            let from = found.nodes.number(names[from as usize], line).unwrap();
            let to = found.nodes.number(names[to as usize], line).unwrap();
            let end = ends.entry((from, to)).or_insert(0u64);
            let start = *end + gap;
            *end = start + length;
            let window = build::window(start, *end, Some(rate), owlt);
            found.contacts.push(build::RawContact {
                from,
                to,
                window,
                confidence,
                line,
            });
        }
        build::plan(found, build::Overlaps::Never).unwrap()
    })
}

/// Some spans of time, one after the other: start, end and a small number.
fn spans() -> impl Strategy<Value = Vec<(u64, u64, u64)>> {
    let span = (prop_oneof![Just(0u64), 1..6u64], 1..12u64, 0..4u64);
    prop::collection::vec(span, 0..6).prop_map(|spans| {
        let mut end = 0;
        let next = |(gap, length, number)| {
            let start = end + gap;
            end = start + length;
            (start, end, number)
        };
        spans.into_iter().map(next).collect()
    })
}

/// The light time and rate at an instant, told by looking at every line.
fn at_instant(text: &str, from: u64, to: u64, at: u64) -> Option<(u64, u64)> {
    let lines = || text.lines().map(|line| line.split(' ').collect::<Vec<_>>());
    let number = |word: &str| word.trim_start_matches('+').parse::<u64>().unwrap();
    let covers = |words: &[&str], kind: &str, a: u64, b: u64| {
        words[1] == kind
            && (number(words[4]), number(words[5])) == (a, b)
            && (number(words[2])..number(words[3])).contains(&at)
    };
    let rate = lines().find(|words| covers(words, "contact", from, to))?;
    // The light time of the last instant of the contact that has a range.
    let covers_then = |words: &[&str], a: u64, b: u64, then: u64| {
        words[1] == "range"
            && (number(words[4]), number(words[5])) == (a, b)
            && (number(words[2])..number(words[3])).contains(&then)
    };
    let owlt = (number(rate[2])..=at).rev().find_map(|then| {
        let owlt = lines().find(|words| covers_then(words, from, to, then));
        owlt.or_else(|| lines().find(|words| to < from && covers_then(words, to, from, then)))
    });
    Some((number(rate[6]) * 8, number(owlt?[6])))
}

proptest! {
    #[test]
    fn plans_read_back_equal(plan in plans()) {
        prop_assert_eq!(ContactPlan::from_ion(plan.to_ion().as_bytes()).unwrap(), plan);
    }

    #[test]
    fn windows_are_in_order_and_come_to_the_summary(plan in plans()) {
        let summary = plan.summary();
        let mut seconds_open = 0.0;
        for (pair, (from, to, windows)) in summary.pairs.iter().zip(plan.pairs()) {
            prop_assert_eq!((pair.from.as_str(), pair.to.as_str()), (from, to));
            prop_assert_eq!(plan.contact_windows(from, to), windows);
            prop_assert!(windows.iter().all(|w| w.start < w.end));
            prop_assert!(windows.windows(2).all(|two| two[0].end <= two[1].start));
            let volume: f64 = windows
                .iter()
                .map(|w| w.rate_bit_per_s.unwrap() as f64 / 8.0 * w.open().as_secs_f64())
                .sum();
            let whole = pair.volume_bytes.unwrap();
            prop_assert!((whole as f64 - volume).abs() <= 1.0 + volume * 1e-9);
            let gap = pair.longest_gap.map_or(SimDuration::ZERO, |gap| gap.length());
            prop_assert!(pair.open + gap <= summary.end.since(summary.start));
            seconds_open += pair.open.as_secs_f64();
        }
        let open: f64 = plan.contacts().map(|c| c.window.open().as_secs_f64()).sum();
        prop_assert!((seconds_open - open).abs() < 1e-6);
    }

    #[test]
    fn every_instant_of_a_contact_has_the_range_that_covers_it(
        forward in spans(),
        back in spans(),
        contacts in [spans(), spans()],
    ) {
        let mut text = String::new();
        for (a, b, spans) in [(1, 2, forward), (2, 1, back)] {
            for (start, end, owlt) in spans {
                text += &format!("a range +{start} +{end} {a} {b} {owlt}\n");
            }
        }
        let ranges = text.clone();
        for ((a, b), spans) in [(1, 2), (2, 1)].into_iter().zip(contacts) {
            for (start, end, rate) in spans {
                // What no range covers when it begins is passed over; the rest must be right.
                let line = format!("a contact +{start} +{end} {a} {b} {}\n", rate + 1);
                let both = format!("{ranges}{line}");
                let is_covered = ContactPlan::from_ion(both.as_bytes()).is_ok();
                let told = at_instant(&format!("{ranges}{line}"), a, b, start).is_some();
                prop_assert_eq!(is_covered, told, "{}{}", ranges, line);
                if is_covered {
                    text += &line;
                }
            }
        }
        let Ok(plan) = ContactPlan::from_ion(text.as_bytes()) else {
            prop_assert!(!text.contains("contact"));
            return Ok(());
        };
        for (from, to) in [(1, 2), (2, 1)] {
            let windows = plan.contact_windows(&from.to_string(), &to.to_string());
            for at in 0..110 {
                let instant = SimTime::ZERO + SimDuration::from_secs(at);
                let open = windows.iter().find(|w| w.start <= instant && instant < w.end);
                let owlt_s = |w: &ContactWindow| w.owlt.as_nanos() / 1_000_000_000;
                let told = open.map(|w| (w.rate_bit_per_s.unwrap(), owlt_s(w)));
                prop_assert_eq!(told, at_instant(&text, from, to, at), "{} at {}", text, at);
            }
        }
    }

    #[test]
    fn opportunities_are_those_of_the_lines_laid_end_to_end(
        steps in prop::collection::vec(0u64..5, 1..12),
        from in 0u64..100,
    ) {
        let stamps: Vec<u64> = steps
            .iter()
            .scan(0, |at, step| { *at += step; Some(*at) })
            .collect();
        let period = *stamps.last().unwrap();
        let text: String = stamps.iter().map(|stamp| format!("{stamp}\n")).collect();
        let trace = CapacityTrace::from_mahimahi(text.as_bytes());
        prop_assume!(period > 0);
        let trace = trace.unwrap();
        let all: Vec<u64> = (0..120)
            .flat_map(|turn| stamps.iter().map(move |stamp| turn * period + stamp))
            .collect();
        let ms = |time: SimTime| time.as_nanos() / 1_000_000;
        for (n, at) in all.iter().enumerate() {
            prop_assert_eq!(ms(trace.opportunity(n as u64)), *at);
        }
        // A nanosecond tells `at` from `after`.
        for more in [0, 1, 500_000, 999_999] {
            let instant = SimTime::from_nanos(from * 1_000_000 + more);
            let first = all.iter().position(|at| at * 1_000_000 >= instant.as_nanos()).unwrap();
            prop_assert_eq!(trace.first_from(instant), first as u64);
            prop_assert_eq!(ms(trace.next_opportunity(instant)), all[first]);
        }
    }

    #[test]
    fn opportunities_are_exact_to_the_end_of_time(
        stamps in prop::collection::vec(0u64..1_000_000, 1..9),
        near in 0u64..=u64::MAX,
    ) {
        let mut stamps = stamps;
        stamps.sort_unstable();
        let text: String = stamps.iter().map(|stamp| format!("{stamp}\n")).collect();
        let Ok(trace) = CapacityTrace::from_mahimahi(text.as_bytes()) else { return Ok(()) };
        for from in [near, u64::MAX, 1 << 53, (1 << 53) + 1].map(SimTime::from_nanos) {
            let n = trace.first_from(from);
            prop_assert!(trace.opportunity(n) >= from);
            prop_assert!(n == 0 || trace.opportunity(n - 1) < from);
        }
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = ContactPlan::from_ion(&bytes).map_err(|e| e.to_string());
        let _ = ContactPlan::from_hdtn(&bytes).map_err(|e| e.to_string());
        let _ = CapacityTrace::from_mahimahi(&bytes).map_err(|e| e.to_string());
    }

    #[test]
    fn any_damage_is_read_or_refused(
        plan in plans(),
        json in any::<bool>(),
        damage in prop::collection::vec(
            (any::<prop::sample::Index>(), "[-+0-9e.\":,\\[\\]{}a-z @/#\n]{0,4}"),
            1..5,
        ),
    ) {
        let lunar = Builtin::find("lunar-relay").unwrap().bytes;
        let mut text = match json {
            true => String::from_utf8_lossy(lunar).into_owned(),
            false => plan.to_ion(),
        };
        for (index, patch) in damage {
            let at = index.index(text.len());
            text.replace_range(at..at + 1, &patch);
        }
        let format = if json { ContactFormat::Hdtn } else { ContactFormat::Ion };
        if let Ok(plan) = ContactPlan::from_bytes(text.as_bytes(), format) {
            prop_assert_eq!(ContactPlan::from_ion(plan.to_ion().as_bytes()).unwrap(), plan);
        }
    }
}
