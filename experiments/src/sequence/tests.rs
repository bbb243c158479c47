//! Charts of records made for the purpose.

use farside::MatchKey;
use farside_logs::{CausedBy, LoggedKey};
use proptest::prelude::*;

use super::*;

fn key(time_ns: u64, source: &str) -> LoggedKey {
    LoggedKey {
        time_ns,
        source: source.to_owned(),
        ..LoggedKey::default()
    }
}

fn record(class: RecordClass, at_ms: u64, sender: &str, receiver: &str) -> LoggedRecord {
    LoggedRecord {
        class,
        topic: format!("/{sender}/grant"),
        key: key(at_ms * 1_000_000, sender),
        cause: None,
        sender: sender.to_owned(),
        receiver: receiver.to_owned(),
        link: None,
        kind: "Grant".to_owned(),
        ordinal: 7,
        copy: 0,
        match_key: None,
        sent_ns: (at_ms - at_ms / 2) * 1_000_000,
        reason: match class {
            RecordClass::Lost => "random loss".to_owned(),
            _ => String::new(),
        },
        body: Vec::new(),
        note: String::new(),
        carriage: None,
    }
}

fn chart(records: Vec<LoggedRecord>) -> Chart {
    let remarks = Vec::new();
    Chart::new("a run".to_owned(), Selected { records, remarks })
}

fn three() -> Vec<LoggedRecord> {
    use RecordClass::{Crash, Delivered, InFlight, Lost};
    let mut keyed = record(InFlight, 40, "b", "a");
    keyed.match_key = Some(MatchKey::new(3, 1));
    vec![
        record(Delivered, 10, "a", "b"),
        record(Lost, 20, "a", "b"),
        record(Crash, 30, "b", "b"),
        record(Crash, 30, "c", "c"),
        keyed,
    ]
}

#[test]
fn mermaid_has_an_arrow_for_each_fate() {
    let expected = "\
---
title: \"a run\"
---
sequenceDiagram
  participant a0 as a
  participant a1 as b
  a0->>a1: 0.01 s: Grant 7, sent 0.005 s
  a0-xa1: 0.02 s: Grant 7, sent 0.01 s, lost: random loss
  Note over a1: 0.03 s: crash
  Note over a0,a1: 0.03 s: crash
  a1--)a0: 0.04 s: Grant 3.1, sent 0.02 s, in flight at the end
";
    assert_eq!(chart(three()).written(Language::Mermaid), expected);
}

#[test]
fn plantuml_has_an_arrow_for_each_fate() {
    let expected = "\
@startuml
title a run
participant \"a\" as a0
participant \"b\" as a1
a0 -> a1 : 0.01 s: Grant 7, sent 0.005 s
a0 ->x a1 : 0.02 s: Grant 7, sent 0.01 s, lost: random loss
note over a1 : 0.03 s: crash
note across : 0.03 s: crash
a1 -->> a0 : 0.04 s: Grant 3.1, sent 0.02 s, in flight at the end
@enduml
";
    assert_eq!(chart(three()).written(Language::Plantuml), expected);
    assert_eq!(chart(three()).told(), "3 messages between 2 actors, 1 lost");
}

#[test]
fn causes_lead_to_what_they_caused_and_losses_to_nothing() {
    use RecordClass::{Delivered, Lost, Timer};
    let timer = record(Timer, 10, "a", "a");
    let mut lost = record(Lost, 10, "a", "b");
    lost.cause = Some(key(10_000_000, "a"));
    let mut delivered = record(Delivered, 20, "b", "c");
    delivered.cause = Some(key(10_000_000, "a"));
    let mut elsewhere = record(Delivered, 30, "c", "d");
    elsewhere.cause = Some(key(1, "nobody"));
    let remarks = vec!["cut\nshort".to_owned()];
    let records = vec![timer, lost, delivered, elsewhere];
    let graph = graph("a \"run\"", Selected { records, remarks });
    let arrows: Vec<&str> = graph
        .text
        .lines()
        .filter(|line| line.contains("->"))
        .collect();
    assert_eq!(arrows, ["  e0 -> e1;", "  e0 -> e2;"]);
    assert_eq!(graph.told, "4 events, 2 causes\n  cut\nshort");
    assert!(
        graph.text.contains("label=\"a \\\"run\\\"\""),
        "{}",
        graph.text
    );
    assert!(graph.text.contains("  // cut\\nshort\n"), "{}", graph.text);
}

#[test]
fn a_chain_is_told_from_its_first_cause_on() {
    let event = |record, repeats| CausedBy { record, repeats };
    let chain = CauseChain {
        events: vec![
            event(record(RecordClass::Delivered, 20, "a", "b"), 0),
            event(record(RecordClass::Timer, 10, "a", "a"), 4),
        ],
        omitted: 3,
        unknown: Some(key(1_000, "c")),
    };
    let selected = super::chain(chain);
    let times: Vec<u64> = selected
        .records
        .iter()
        .map(|record| record.key.time_ns)
        .collect();
    assert_eq!(times, [10_000_000, 20_000_000]);
    assert_eq!(selected.records[0].note, "and 4 times before");
    assert_eq!(selected.remarks.len(), 2);
}

#[test]
fn who_is_not_there_is_found_out() {
    let actors: Vec<Actors> = ["a", "nobody*"]
        .iter()
        .map(|text| text.parse().unwrap())
        .collect();
    let selected = Selected {
        records: three(),
        remarks: Vec::new(),
    };
    assert_eq!(selected.unknown(&actors).unwrap().to_string(), "nobody*");
    assert_eq!(selected.of(&actors).records.len(), 3);
}

proptest! {
    /// However many messages there are, each is shown, or is said to be left out.
    #[test]
    fn no_message_is_left_out_silently(
        count in 0_usize..3_000,
        actors in 2_u64..60,
        spread in 1_u64..50,
    ) {
        let name = |number: u64| format!("r{}", number % actors);
        let records = (0..count as u64).map(|number| {
            let class = if number % 7 == 0 { RecordClass::Lost } else { RecordClass::Delivered };
            record(class, 1 + number / spread, &name(number * number), &name(number * 3 + 1))
        });
        let chart = chart(records.collect());
        let shown: u64 = chart.steps.iter().map(Step::messages).sum();
        let arrows = chart.steps.iter().filter(|step| step.messages() > 0).count();
        prop_assert!(arrows <= ARROWS);
        let text = chart.told();
        let left: u64 = text
            .lines()
            .filter(|line| line.contains(" are left out"))
            .map(|line| line.split_whitespace().next().unwrap().parse::<u64>().unwrap())
            .sum();
        prop_assert_eq!(shown + left, count as u64);
        prop_assert!(chart.written(Language::Mermaid).len() < 50_000);
    }

    /// What names and reasons say is never read as a part of the language.
    #[test]
    fn names_stay_names(name in "[ -~\\n\\t]{1,40}", reason in "[ -~\\n]{0,40}") {
        let mut lost = record(RecordClass::Lost, 5, &name, "b");
        lost.reason = reason;
        let plain = chart(vec![record(RecordClass::Lost, 5, "a", "b")]);
        let odd = chart(vec![lost.clone()]);
        for language in [Language::Mermaid, Language::Plantuml] {
            prop_assert_eq!(
                odd.written(language).lines().count(),
                plain.written(language).lines().count()
            );
        }
        let mermaid = odd.written(Language::Mermaid);
        for line in mermaid.lines().skip(4) {
            let codes = line.matches('#').count();
            prop_assert_eq!(line.matches(';').count(), codes, "{}", line);
        }
        let records = vec![lost];
        let graph = graph(&name, Selected { records, remarks: Vec::new() });
        prop_assert_eq!(graph.text.lines().count(), 5);
    }
}
