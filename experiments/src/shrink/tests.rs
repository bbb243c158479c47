//! Small scenarios made smaller.

use std::path::Path;

use farside_actors::system::Files;
use proptest::prelude::*;

use super::*;

/// Four rovers report to a lander over links that lose, one of which is out for a while.
const TRAFFIC: &str = "
    system = 'traffic'
    seed = 3
    until = '20s'
    crash = [{ actor = 'rover_2', at = '15s' }]
    [links.default]
    loss = 0.1
    [links.'rover_4-lander']
    latency = '90ms'
    [traffic]
    hosts = ['lander', 'earth']
    groups = [{ prefix = 'rover', count = 4 }]
    [[traffic.flow]]
    from = 'rover_*'
    to = 'lander'
    period = '1s'
    [[traffic.flow]]
    from = 'lander'
    to = 'earth'
    period = '2s'
    [[degrade]]
    at = '3s'
    until = '4s'
    links = 'rover_1-lander'
    outage = true
";

/// Six rovers on a small roadmap, some of which move on without a grant.
const UNBIDDEN: &str = "
    system = 'network'
    seed = 1
    until = '60s'
    crash = [{ actor = 'rover_04', at = '1s' }, { host = 'node_03', at = '2s', restart = '4s' }]
    [world]
    roadmap = 'crater-sparse'
    nodes = 28
    [team]
    rovers = 6
    [network]
    sabotage = { move_unbidden = 0.5 }
    [links.default]
    loss = 0.1
";

fn read(text: &str) -> Scenario {
    let files = Files::on_disk(std::path::PathBuf::new());
    let registry = Registry::builtin();
    Scenario::parse("test", text.to_owned(), &[], &registry, files).unwrap()
}

fn forbidden(scenario: &Scenario, violates: &str) -> Forbidden {
    let registry = Registry::builtin();
    let system = registry.find(&scenario.shared().system).unwrap();
    Forbidden::parse(violates, system).unwrap()
}

fn shrunk_with(
    text: &str,
    violates: &str,
    (jobs, budget): (usize, Option<Budget>),
    state: &Path,
) -> Result<Shrunk, ShrinkError> {
    let scenario = read(text);
    let options = ShrinkOptions {
        forbidden: &forbidden(&scenario, violates),
        jobs,
        budget,
        state,
        interrupt: Arc::default(),
        tell: &|_| {},
    };
    shrink(&scenario, &Registry::builtin(), &options, &mut |_| {})
}

fn shrunk(text: &str, violates: &str) -> Shrunk {
    let folder = tempfile::tempdir().unwrap();
    shrunk_with(text, violates, (2, None), &folder.path().join("tried")).unwrap()
}

/// Whether it happens in a run of a scenario that is written like this, by what the run itself says.
fn happens(table: &Table) -> bool {
    let text = toml::to_string(table).unwrap();
    let files = Files::on_disk(std::path::PathBuf::new());
    let registry = Registry::builtin();
    let Ok(scenario) = Scenario::parse("test", text, &[], &registry, files) else {
        return false;
    };
    let Ok(assembled) = scenario.assemble() else {
        return false;
    };
    let report = assembled.sim.run(farside::Executor::Inline).unwrap();
    !(assembled.system.conclude)(&report).violations.is_empty()
}

/// Each scenario with one entry less of the arrays at these keys, worked out anew.
fn with_one_less(table: &Table, keys: &[&str]) -> Vec<Table> {
    let mut all = Vec::new();
    for key in keys {
        let find = |table: &mut Table, at: Option<usize>| -> usize {
            let mut steps: Vec<&str> = key.split('.').collect();
            let last = steps.pop().unwrap();
            let mut within = table;
            for step in steps {
                match within.get_mut(step) {
                    Some(Value::Table(next)) => within = next,
                    _ => return 0,
                }
            }
            let Some(Value::Array(entries)) = within.get_mut(last) else {
                return 0;
            };
            let count = entries.len();
            if let Some(at) = at {
                entries.remove(at);
            }
            count
        };
        for at in 0..find(&mut table.clone(), None) {
            let mut less = table.clone();
            find(&mut less, Some(at));
            // An empty list of members means all of them.
            let is_nobody = |table: &Table| {
                let only = table.get("team").and_then(|team| team.get("only"));
                only.and_then(Value::as_array).is_some_and(Vec::is_empty)
            };
            if !is_nobody(&less) {
                all.push(less);
            }
        }
    }
    all
}

fn left(shrunk: &Shrunk, key: &str) -> usize {
    let found = shrunk.left.iter().find(|left| left.key == key);
    found
        .unwrap_or_else(|| panic!("{key} in {:?}", shrunk.left))
        .left
}

#[test]
fn a_loss_takes_one_flow_and_one_loss() {
    let shrunk = shrunk(TRAFFIC, "loss");
    assert_eq!(shrunk.end, ShrinkEnd::Minimal);
    for (key, expected) in [("traffic.flow", 1), ("crash", 0), ("links", 0)] {
        assert_eq!(left(&shrunk, key), expected, "{key} in {:?}", shrunk.left);
    }
    assert_eq!((left(&shrunk, "degrade"), left(&shrunk, "lose")), (0, 1));
    assert!(happens(&shrunk.table));
    for less in with_one_less(&shrunk.table, &["lose", "traffic.flow", "traffic.hosts"]) {
        assert!(!happens(&less), "{less}");
    }
}

#[test]
fn of_what_links_lose_by_chance_one_message_is_left() {
    let shrunk = shrunk(TRAFFIC, "lost>0");
    assert_eq!(shrunk.end, ShrinkEnd::Minimal);
    let links = shrunk
        .table
        .get("links")
        .and_then(|links| links.get("default"));
    assert!(
        links.is_none_or(|links| links.get("loss").is_none()),
        "{}",
        shrunk.table
    );
    let causes = ["lose", "degrade"].map(|key| shrunk.table.get(key).and_then(Value::as_array));
    let causes: usize = causes.into_iter().flatten().map(Vec::len).sum();
    assert_eq!(causes, 1, "{}", shrunk.table);
    assert!(happens(&shrunk.table));
    for less in with_one_less(
        &shrunk.table,
        &["lose", "degrade", "traffic.flow", "traffic.hosts"],
    ) {
        assert!(!happens(&less), "{less}");
    }
}

#[test]
fn a_collision_takes_two_rovers_and_no_crash_of_others() {
    let shrunk = shrunk(UNBIDDEN, "collision");
    assert_eq!(shrunk.end, ShrinkEnd::Minimal);
    assert_eq!((left(&shrunk, "team.only"), left(&shrunk, "crash")), (2, 0));
    assert!(happens(&shrunk.table));
    for less in with_one_less(&shrunk.table, &["team.only", "lose"]) {
        assert!(!happens(&less), "{less}");
    }
}

#[test]
fn the_result_does_not_hang_on_how_many_runs_there_are_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let with = |jobs: usize, budget| {
        let state = folder.path().join(format!("{jobs}-{budget:?}"));
        let budget = Some(Budget::Runs(budget));
        let shrunk = shrunk_with(TRAFFIC, "lost>0", (jobs, budget), &state).unwrap();
        (shrunk.table, shrunk.runs, shrunk.end, shrunk.left)
    };
    for budget in [7, 1000] {
        let one = with(1, budget);
        for jobs in [2, 5] {
            assert_eq!(one, with(jobs, budget), "{jobs} jobs, {budget} runs");
        }
    }
}

#[test]
fn a_search_that_is_started_again_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let state = folder.path().join("tried");
    let whole = shrunk(TRAFFIC, "lost>0");
    let mut starts = 0;
    let last = loop {
        starts += 1;
        let some = (1, Some(Budget::Runs(8)));
        let shrunk = shrunk_with(TRAFFIC, "lost>0", some, &state).unwrap();
        assert!(happens(&shrunk.table), "what is found is good at any time");
        if shrunk.end == ShrinkEnd::Minimal {
            break shrunk;
        }
    };
    assert!(starts > 2, "{starts}");
    assert_eq!(last.table, whole.table);
    let again = shrunk_with(TRAFFIC, "lost>0", (1, None), &state).unwrap();
    assert_eq!((again.table, again.runs), (whole.table, 0));
    let raised = Arc::new(AtomicBool::new(true));
    let scenario = read(TRAFFIC);
    let options = ShrinkOptions {
        forbidden: &forbidden(&scenario, "lost>0"),
        jobs: 2,
        budget: None,
        state: &folder.path().join("other"),
        interrupt: raised,
        tell: &|_| {},
    };
    let error = shrink(&scenario, &Registry::builtin(), &options, &mut |_| {}).err();
    assert!(matches!(error, Some(ShrinkError::Interrupted)));
}

#[test]
fn what_does_not_fail_is_not_made_small() {
    let folder = tempfile::tempdir().unwrap();
    let error = |text: &str, violates: &str, state: &str| {
        let state = folder.path().join(state);
        let tried = shrunk_with(text, violates, (1, None), &state);
        tried.err().unwrap().to_string()
    };
    assert_eq!(
        error(TRAFFIC, "sim_time_s>20", "a"),
        "test: sim_time_s>20 does not happen: the run stopped at 20s: until 20s; there is nothing to \
         make small"
    );
    let nobody = UNBIDDEN.replace("'rover_04'", "'rover_44'");
    let unknown = error(&nobody, "collision", "b");
    assert!(unknown.contains("did you mean \"rover_04\"?"), "{unknown}");
}

fn flow() -> impl Strategy<Value = String> {
    let host = || prop::sample::select(vec!["a", "b", "c", "d_*"]);
    (host(), host(), 300_u32..3000).prop_filter_map("flows have two ends", |(from, to, period)| {
        (from != to).then(|| {
            format!("[[traffic.flow]]\nfrom = '{from}'\nto = '{to}'\nperiod = '{period}ms'\n")
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// Whatever the scenario, and whatever happens in it: with what is left it happens, and not with one
    /// entry less.
    #[test]
    fn what_is_left_fails_and_is_1_minimal(
        seed in 0_u32..1000,
        flows in prop::collection::vec(flow(), 1..5),
        loss in 0_u32..40,
        violates in prop::sample::select(vec!["lost>2", "delivered<25", "delay_max_s>0.05", "lost>0"]),
    ) {
        let text = format!(
            "system = 'traffic'\nseed = {seed}\nuntil = '6s'\n\
             degrade = [{{ at = '2s', until = '3s', links = '*-a', latency = '80ms' }}, \
             {{ at = '4s', links = '*-b', loss = '50%' }}]\n\
             [links]\ndefault = {{ loss = '{loss}%', jitter = '2ms' }}\n\
             [traffic]\nhosts = ['a', 'b', 'c']\ngroups = [{{ prefix = 'd', count = 3 }}]\n{}",
            flows.concat()
        );
        // Not all flows have links to a and b, and not all scenarios fail.
        let folder = tempfile::tempdir().unwrap();
        let state = folder.path().join("tried");
        let Ok(shrunk) = shrunk_with(&text, violates, (2, None), &state) else {
            return Ok(());
        };
        prop_assert_eq!(shrunk.end, ShrinkEnd::Minimal);
        prop_assert!(happens(&shrunk.table), "{}", shrunk.table);
        let keys = ["lose", "degrade", "traffic.flow", "traffic.hosts", "traffic.groups"];
        for less in with_one_less(&shrunk.table, &keys) {
            prop_assert!(!happens(&less), "{}\n\nand then\n\n{less}", shrunk.table);
        }
    }
}
