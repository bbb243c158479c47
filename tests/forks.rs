//! Forks of a run: what comes before a fork is the run itself, record by record, whatever is changed from then
//! on; a fork at the start is the changed run; what cannot change in mid-run is refused.

use std::fmt::Write as _;
use std::sync::{Arc, Mutex};

use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{Executor, RunInfo, SimTime};
use farside_actors::system::Files;
use farside_experiments::registry::Registry;
use farside_experiments::scenario::Scenario;
use proptest::prelude::*;

/// Planned for instants before and after any fork, in no order: what is added must not renumber it.
const BASE: &str = r#"
system = "network"
seed = 3
until = "14s"
[world]
roadmap = "crater-sparse"
nodes = 28
[team]
rovers = 6
[links.default]
latency = "5ms"
jitter = "2ms"
loss = 0.05
[[degrade]]
links = "node_0*-*"
at = "6s"
until = "8s"
loss = 0.4
[[crash]]
actor = "node_05"
at = "9s"
restart = "11s"
[[crash]]
actor = "node_02"
at = "1s"
restart = "3s"
"#;

/// All records of a run, each as a text with all that the digest has of it.
#[derive(Clone, Default)]
struct Everything {
    names: Arc<Mutex<Option<Arc<RunInfo>>>>,
    records: Arc<Mutex<Vec<(SimTime, String)>>>,
    /// Messages that a link decided about: when they were sent, and what they are called.
    carried: Arc<Mutex<Vec<(SimTime, String)>>>,
}

impl Observer for Everything {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            ..Wants::default()
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        *self.names.lock().unwrap() = Some(run.clone());
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let names = self.names.lock().unwrap().clone().unwrap();
        let (sender, receiver) = (names.name(record.sender), names.name(record.receiver));
        let kind = record.kind.map_or("", |kind| kind.name());
        let mut text = format!(
            "{} {} {sender} {receiver} {kind}",
            record.class.name(),
            record.key
        );
        write!(
            text,
            " {} {} {:?} {:?} {} {} {:x?}",
            record.ordinal,
            record.copy,
            record.match_key,
            record.cause,
            record.sent,
            record.reason,
            record.body
        )
        .unwrap();
        let is_decided = matches!(record.class, RecordClass::Delivered | RecordClass::Lost);
        if is_decided && record.link.is_some() {
            let id = format!("{sender},{receiver},{kind},{}", record.ordinal);
            self.carried.lock().unwrap().push((record.sent, id));
        }
        self.records.lock().unwrap().push((record.time(), text));
        Ok(Flow::Continue)
    }
}

fn scenario(text: &str) -> Scenario {
    parse(text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn parse(text: &str) -> Result<Scenario, String> {
    let files = Files::on_disk(std::path::PathBuf::new());
    let parsed = Scenario::parse(
        "fork.toml",
        text.to_owned(),
        &[],
        &Registry::builtin(),
        files,
    );
    parsed.map_err(|error| error.to_string())
}

fn run(text: &str, executor: Executor) -> (String, Everything) {
    let mut assembled = scenario(text)
        .assemble()
        .unwrap_or_else(|error| panic!("{error}\n{text}"));
    let everything = Everything::default();
    assembled.sim.observe(everything.clone());
    let report = assembled.sim.run(executor).unwrap();
    (report.digest.to_string(), everything)
}

/// What comes before `at`.
fn before(records: &Everything, at: SimTime) -> Vec<String> {
    let records = records.records.lock().unwrap();
    let before = records.iter().filter(|(time, _)| *time < at);
    before.map(|(_, text)| text.clone()).collect()
}

/// What is changed.
#[derive(Clone, Debug)]
enum Change {
    Set(&'static str),
    Crash(u32),
    Message {
        what: usize,
        which: prop::sample::Index,
    },
}

fn change() -> impl Strategy<Value = Change> {
    let sets = [
        "links.default.loss=0.5",
        "links.default.latency=9ms",
        "links.default.outage=true",
        "links.'node_*-rover_*'.jitter=4ms",
        "degrade=[]",
        "crash=[]",
        "degrade.0.loss=1.0",
        "crash.0.at=10s",
        "until=13s",
        "network.max_plus.noise=0.2",
    ];
    prop_oneof![
        3 => prop::sample::select(sets.to_vec()).prop_map(Change::Set),
        1 => (1_u32..=28).prop_map(Change::Crash),
        3 => (0_usize..3, any::<prop::sample::Index>())
            .prop_map(|(what, which)| Change::Message { what, which }),
    ]
}

/// The text of a fork, and from when on it is another run.
fn fork(base: &Everything, at_ms: u64, changes: &[Change]) -> (String, SimTime) {
    let at = SimTime::from_nanos(at_ms * 1_000_000);
    let (mut sets, mut tables) = (Vec::new(), String::new());
    // Entries that one change takes away cannot be set by another.
    let mut tables_set: Vec<&str> = Vec::new();
    for change in changes {
        let table = match change {
            Change::Set(set) => ["crash", "degrade"]
                .into_iter()
                .find(|root| set.starts_with(root)),
            Change::Crash(_) => Some("crash"),
            Change::Message { .. } => None,
        };
        if table.is_some_and(|table| tables_set.contains(&table)) {
            continue;
        }
        tables_set.extend(table);
        match change {
            Change::Set("crash.0.at=10s") if at_ms >= 9_000 => {}
            Change::Set(set) => sets.push(format!("{set:?}")),
            Change::Crash(node) => {
                let crash = format!("crash=[{{ host = 'node_{node:02}', at = '{at_ms}ms' }}]");
                sets.push(format!("{crash:?}"));
            }
            Change::Message { what, which } => {
                let carried = base.carried.lock().unwrap();
                let later: Vec<_> = carried.iter().filter(|(sent, _)| *sent >= at).collect();
                if later.is_empty() {
                    continue;
                }
                let (_, id) = later[which.index(later.len())];
                let (table, by) =
                    [("lose", ""), ("deliver", ""), ("postpone", "by = '70ms'")][*what];
                write!(tables, "[[{table}]]\nmessage = {id:?}\n{by}\n").unwrap();
            }
        }
    }
    let forks = match sets.is_empty() {
        true => String::new(),
        false => format!("[[fork]]\nat = '{at_ms}ms'\nset = [{}]\n", sets.join(", ")),
    };
    (format!("{BASE}{forks}{tables}"), at)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// With numbers of control events in order of declaration, or a ruling that meets another message, this is
    /// red.
    #[test]
    fn what_comes_before_a_fork_is_the_run_itself(
        at_ms in 500_u64..13_000,
        changes in prop::collection::vec(change(), 1..4),
    ) {
        static BASE_RUN: std::sync::LazyLock<Everything> =
            std::sync::LazyLock::new(|| run(BASE, Executor::Inline).1);
        let (text, at) = fork(&BASE_RUN, at_ms, &changes);
        let (digest, forked) = run(&text, Executor::Inline);
        prop_assert_eq!(before(&BASE_RUN, at), before(&forked, at));
        let (side_by_side, _) = run(&text, Executor::Kameo { threads: 2 });
        prop_assert_eq!(&digest, &side_by_side);
        // What a log keeps of it is the same run.
        let resolved = scenario(&text).resolved().unwrap();
        prop_assert_eq!(&run(&resolved, Executor::Inline).0, &digest);
    }
}

#[test]
fn from_a_fork_on_links_are_as_set() {
    let losses = |text: &str, from: u64| {
        let (_, all) = run(text, Executor::Inline);
        let records = all.records.lock().unwrap();
        let later = records
            .iter()
            .filter(|(time, _)| *time >= SimTime::from_nanos(from * 1_000_000));
        let lost = later.clone().filter(|(_, text)| text.starts_with("lost"));
        (
            lost.count(),
            later
                .filter(|(_, text)| text.starts_with("delivered"))
                .count(),
        )
    };
    let text =
        format!("{BASE}[[fork]]\nat = '12s'\nset = ['links.default.loss=1.0', 'crash=[]']\n");
    let (lost, delivered) = losses(&text, 12_010);
    assert!(
        lost > 10 && delivered < lost / 5,
        "{lost} lost, {delivered} delivered"
    );
    let (lost, delivered) = losses(BASE, 12_010);
    assert!(delivered > lost * 5, "{lost} lost, {delivered} delivered");
}

/// A crash and its return that a fork takes back do not happen; one that it moves happens where it is moved to.
#[test]
fn a_fork_takes_back_what_is_planned() {
    let events = |text: &str| {
        let (_, all) = run(text, Executor::Inline);
        let records = all.records.lock().unwrap();
        let planned = records
            .iter()
            .filter(|(_, text)| text.starts_with("crash") || text.starts_with("restart"));
        let planned = planned.map(|(time, text)| {
            let name = text
                .split(' ')
                .find(|word| word.starts_with("node"))
                .unwrap();
            (time.as_nanos() / 1_000_000_000, name.to_owned())
        });
        planned.collect::<Vec<_>>()
    };
    let node = |number: u32| format!("node_{number:02}");
    let (two, five) = (node(2), node(5));
    let all = [(1, &two), (3, &two), (9, &five), (11, &five)];
    let expected = |n: &[(u64, &String)]| -> Vec<(u64, String)> {
        n.iter().map(|(at, name)| (*at, (*name).clone())).collect()
    };
    assert_eq!(events(BASE), expected(&all));
    let forked = |at: &str, set: &str| format!("{BASE}[[fork]]\nat = '{at}'\nset = [\"{set}\"]\n");
    assert_eq!(events(&forked("2s", "crash=[]")), expected(&all[..1]));
    assert_eq!(
        events(&forked("5s", "crash.0.at=10s")),
        expected(&[all[0], all[1], (10, &five), all[3]])
    );
}

/// Settings of nodes are taken up by a restart; what is before stays.
#[test]
fn nodes_take_up_settings_in_a_restart() {
    let text = format!("{BASE}[[fork]]\nat = '5s'\nset = ['network.max_plus.noise=0.3']\n");
    let (digest, all) = run(&text, Executor::Inline);
    assert_ne!(digest, run(BASE, Executor::Inline).0);
    let records = all.records.lock().unwrap();
    let restarts = records
        .iter()
        .filter(|(time, text)| *time == SimTime::from_secs(5) && text.starts_with("restart"));
    assert_eq!(restarts.count(), 28);
}

#[test]
fn what_cannot_change_in_mid_run_is_refused() {
    let cases = [
        (
            "at = '5s'\nset = ['seed=4']",
            "seeds cannot change in mid-run",
        ),
        ("at = '5s'\nset = ['system=\"traffic\"']", "fork.0.set"),
        (
            "at = '5s'\nset = ['team.rovers=7']",
            "run the changed scenario from the start",
        ),
        (
            "at = '5s'\nset = ['network.policy=complete']",
            "run the changed scenario from the start",
        ),
        (
            "at = '5s'\nset = ['links.\"nod_*\".loss=0.1']",
            "matches no link",
        ),
        (
            "at = '5s'\nset = ['links.default.los=0.1']",
            "did you mean \"loss\"",
        ),
        ("at = '5s'\nset = ['fork=[]']", "a fork within a fork"),
        ("at = '5s'\nset = []", "expected what is set"),
        (
            "at = '0s'\nset = ['links.default.loss=0.1']",
            "expected a time over zero",
        ),
        (
            "at = '5s'\nset = ['links.default.loss=0.1']\n[[fork]]\nat = '5s'\nset = ['links.default.loss=0.2']",
            "expected a time after that of the entry before",
        ),
        (
            "at = '5s'\nset = ['links.default.loss=0.1']\n[[lose]]\nmessage = 'node_01'",
            "names no message",
        ),
        (
            "at = '5s'\nset = ['links.default.loss=0.1']\n[[postpone]]\nmessage = 'a,b,C,1'",
            "over zero",
        ),
    ];
    for (entry, expected) in cases {
        let text = format!("{BASE}[[fork]]\n{entry}\n");
        let error = match parse(&text) {
            Err(error) => error,
            Ok(scenario) => scenario
                .assemble()
                .err()
                .map_or(String::new(), |error| error.to_string()),
        };
        assert!(error.contains(expected), "{entry}: {error:?}");
    }
    let text = format!("{BASE}[[lose]]\nmessage = 'node_99,rover_01,Assignments,1'\n");
    let assembled = scenario(&text).assemble().unwrap();
    let error = assembled.sim.run(Executor::Inline).unwrap_err().to_string();
    assert!(error.contains("no actor is called \"node_99\""), "{error}");
}

/// Each entry that met no message, or changed nothing, is said.
#[test]
fn rulings_without_effect_are_said() {
    let (_, base) = run(BASE, Executor::Inline);
    let id = base.carried.lock().unwrap()[0].1.clone();
    let flow = id.rsplit_once(',').unwrap().0.to_owned();
    let text = format!("{BASE}[[lose]]\nmessage = '{flow},999999'\n[[lose]]\nmessage = '{id}'\n");
    let assembled = scenario(&text).assemble().unwrap();
    let report = assembled.sim.run(Executor::Inline).unwrap();
    let ends: Vec<u8> = report.rulings.iter().map(|end| *end as u8).collect();
    assert_eq!(ends, [0, 2]);
}
