//! Contact plans as other programs write them, and links whose keys have no effect.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use farside::record::{Flow, Observer, ObserverError, Record, RecordClass};
use farside::{Executor, Report, SimDuration};
use farside_actors::system::Files;
use farside_experiments::registry::Registry;
use farside_experiments::scenario::{Assembled, Scenario, ScenarioError};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("cases/links")
}

fn assembled(text: String) -> Result<Assembled, ScenarioError> {
    let files = Files::on_disk(folder());
    let registry = Registry::builtin();
    Scenario::parse("case.toml", text, &[], &registry, files)?.assemble()
}

/// A second of traffic from `a` to `b` by a plan, and with these keys of `[contacts]`.
fn by_plan(file: &str, keys: &str) -> Result<Assembled, ScenarioError> {
    assembled(format!(
        "system = 'traffic'\nuntil = '400s'\n\
         contacts = {{ file = '{file}', nodes = {{ 1 = 'a', 2 = 'b' }}, {keys} }}\n\
         [traffic]\nhosts = ['a', 'b']\nflow = [{{ from = 'a', to = 'b', size = '1kB', period = '1s' }}]\n\
         [links.default]\nstore_and_forward = true\n"
    ))
}

/// A contact: when it begins and ends \[s\], its light time \[s\], and the bytes that fit through
/// it.
type Told = (u64, u64, u64, Option<u64>);

fn contacts(assembled: &Assembled, from: &str, to: &str) -> Vec<Told> {
    let contacts = assembled.contacts.as_ref().expect("it has a plan");
    let windows = contacts.windows(from, to).expect("the plan names both");
    let told = windows.iter().map(|window| {
        let seconds = |nanos: u64| nanos / 1_000_000_000;
        let [start, end] = [window.start, window.end].map(|at| seconds(at.as_nanos()));
        (
            start,
            end,
            seconds(window.owlt.as_nanos()),
            window.volume_bytes(),
        )
    });
    told.collect()
}

/// Each plan, its contacts from `a` to `b`, and what the only remark on it begins with, if there
/// is one.
const PLANS: [(&str, Told, &str); 10] = [
    ("combined.rc", (0, 60, 1, Some(60_000)), ""),
    (
        "hypothetical.ionrc",
        (0, 60, 1, Some(60_000)),
        "line 2: the contact is hypothetical: it is passed over",
    ),
    ("announce.ionrc", (0, 60, 1, Some(60_000)), ""),
    (
        "range-ends-early.ionrc",
        (30, 200, 3, Some(170_000)),
        "line 2: no range covers the contact from 1 to 2 from 100s on: its light time stays",
    ),
    ("no-owlt.json", (0, 60, 0, Some(60_000)), ""),
    ("rate-0.json", (0, 60, 1, None), ""),
    (
        "overlap-same-rate.json",
        (0, 90, 1, Some(90_000)),
        "line 1: the contact overlaps that of line 1: they are one",
    ),
    (
        "empty-contact.json",
        (0, 60, 1, Some(60_000)),
        "line 1: the contact ends as it begins: it is passed over",
    ),
    (
        "confidence.ionrc",
        (0, 60, 1, Some(6_000_000)),
        "line 2: confidence 0.1 is not used: the contact takes place",
    ),
    ("bom.ionrc", (0, 60, 1, Some(60_000)), ""),
];

#[test]
fn plans_are_read_as_the_programs_read_them_that_they_are_for() {
    for (file, told, remark) in PLANS {
        let assembled = by_plan(file, "").unwrap_or_else(|error| panic!("{file}: {error}"));
        assert_eq!(contacts(&assembled, "a", "b"), [told], "{file}");
        let expected = format!("contacts: {file}: {remark}");
        let remarks = &assembled.remarks;
        let said = match remark {
            "" => remarks.is_empty(),
            _ => remarks.len() == 1 && remarks[0].starts_with(&expected),
        };
        assert!(said, "{file}: {remarks:?}");
    }
}

#[test]
fn a_contact_without_a_range_is_passed_over_or_has_the_one_that_the_scenario_gives() {
    let file = "range-missing.ionrc";
    let without = by_plan(file, "").expect("the other contact has a range");
    assert_eq!(contacts(&without, "a", "b"), []);
    let both = (0, 60, 1, Some(60_000));
    assert_eq!(contacts(&without, "b", "a"), [both]);
    let start = "contacts: range-missing.ionrc: line 3: no range covers the contact from 1 to 2";
    let remarks = &without.remarks;
    assert!(
        remarks.len() == 1 && remarks[0].starts_with(start),
        "{remarks:?}"
    );
    let with = by_plan(file, "range = '2s'").expect("all contacts have a light time");
    let given = (0, 60, 2, Some(60_000));
    assert_eq!(contacts(&with, "a", "b"), [given]);
    assert_eq!(contacts(&with, "b", "a"), [both]);
    assert_eq!(with.remarks, [""; 0]);
    let hdtn = by_plan("no-owlt.json", "range = '2s'").expect("it is a plan");
    assert_eq!(contacts(&hdtn, "a", "b"), [given]);
}

#[test]
fn dates_beside_times_from_nowhere_are_named_as_the_cause() {
    let error = by_plan("mixed-times.ionrc", "").err();
    let error = error.expect("nobody knows when +0 is").to_string();
    assert!(
        error.contains("line 1: times such as +0 beside dates: expected an `@` line with a date"),
        "{error}"
    );
}

/// What is said of one of the scenarios, which is assembled.
fn remarks(file: &str) -> Vec<String> {
    let text = std::fs::read_to_string(folder().join(file)).expect("the file is there");
    assembled(text).expect("it is a scenario").remarks
}

#[test]
fn what_a_contact_has_its_own_of_is_said_to_have_no_effect() {
    let said = remarks("degrade-on-contact.toml");
    for key in ["latency", "rate"] {
        let what = format!("links: {key} has no effect in contacts that have their own");
        assert!(said.contains(&what), "{key}: {said:?}");
    }
    let idle = by_plan("bom.ionrc", "range = '2s'").expect("it is a plan");
    let what = "contacts.range has no effect: every contact has a light time of its own";
    assert_eq!(idle.remarks, [what]);
}

#[test]
fn a_packet_that_comes_in_the_millisecond_of_an_opportunity_misses_it() {
    let (delays, _) = delays("mahimahi-tie.toml");
    assert!(delays.len() >= 200);
    let wrong = delays.iter().find(|delay| delay.as_nanos() != 21_000_000);
    assert_eq!(wrong, None);
}

/// The delays of all messages that arrive in one of the scenarios, and what the run comes to.
fn delays(file: &str) -> (Vec<SimDuration>, Report) {
    let text = std::fs::read_to_string(folder().join(file)).expect("the file is there");
    let mut assembled = assembled(text).expect("it is a scenario");
    let delays = Arc::new(Mutex::new(Vec::new()));
    assembled.sim.observe(Delays(delays.clone()));
    let report = assembled.sim.run(Executor::Inline).expect("it runs");
    let delays = delays.lock().expect("nobody panicked").clone();
    (delays, report)
}

#[test]
fn a_relay_carries_a_quarter_of_its_rate() {
    let (delays, report) = delays("lunar-relay.toml");
    let counts = &report.counts;
    assert_eq!((counts.sent, counts.delivered), (12_000, 12_000));
    // What is kept of messages whose acknowledgement is lost is no loss.
    let kept = counts.lost_by_reason.get("duplicate").copied();
    assert_eq!(counts.lost, kept.unwrap_or(0));
    // 13.25 ms on the air and 60 ms on the way, and waits for what is sent again.
    let mean_s = delays.iter().map(|d| d.as_secs_f64()).sum::<f64>() / delays.len() as f64;
    assert!((0.073..0.085).contains(&mean_s), "{mean_s}");
}

#[test]
fn what_waits_for_a_contact_costs_a_few_events_each() {
    let (delays, report) = delays("waiting-160000.toml");
    assert_eq!(delays.len(), 160_000);
    assert!(report.counts.events < 2 * 160_000);
}

/// What is said of a second of traffic over these links, radios and degradations.
fn remarks_on(keys: &str) -> Vec<String> {
    let told = assembled(format!(
        "system = 'traffic'\nuntil = '400s'\n[traffic]\nhosts = ['a', 'b']\n\
         flow = [{{ from = 'a', to = 'b', size = '1kB', period = '1s' }}]\n{keys}\n"
    ));
    told.expect("it is a scenario").remarks
}

#[test]
fn what_a_degradation_sets_and_links_have_anyway_is_said_to_have_no_effect() {
    let worse = "[links.default]\nlatency = '2s'\n\
                 [[degrade]]\nat = '1s'\nuntil = '9s'\nlinks = '*'\nlatency = '2s'\nloss = 0.5";
    let what = "degrade.0.latency has no effect: its links have that value anyway";
    assert_eq!(remarks_on(worse), [what]);
    // It ends what another one began.
    let ends = format!("{worse}\n[[degrade]]\nat = '3s'\nlinks = '*'\nlatency = '9s'");
    assert_eq!(remarks_on(&ends), [""; 0]);
    let later = ends.replace("at = '3s'", "at = '9s'");
    assert_eq!(remarks_on(&later), [what]);
}

#[test]
fn what_radios_are_told_without_effect_is_said() {
    let radio = "[radios.uhf]\naccess = 'scheduled'\nslot = '2ms'";
    let unused = format!("[links.default]\nrate = '1Mbit/s'\n{radio}");
    assert_eq!(remarks_on(&unused), ["radios.uhf: no link goes through it"]);
    let used = format!("[links.default]\nradio = 'uhf'\nrate = '1Mbit/s'\nmtu = '1kB'\n{radio}");
    assert_eq!(
        remarks_on(&used),
        [
            "links: mtu and fragment_header have no effect through a radio: messages go as a whole",
            "radios.uhf.slot without aloha or csma: nobody waits at random"
        ]
    );
}

/// The delays of all messages over links.
struct Delays(Arc<Mutex<Vec<SimDuration>>>);

impl Observer for Delays {
    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        if record.class == RecordClass::Delivered && record.link.is_some() {
            let mut delays = self.0.lock().expect("nobody panicked");
            delays.push(record.time().since(record.sent));
        }
        Ok(Flow::Continue)
    }
}
