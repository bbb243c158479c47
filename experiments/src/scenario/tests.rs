//! What the reader of scenarios promises: one clear message for each mistake, and resolved
//! scenarios that give the same run.

use farside::Executor;
use farside_actors::link::Preset;

use super::*;

fn parse(text: &str, sets: &[&str]) -> Result<Scenario, ScenarioError> {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    let files = Files::on_disk(PathBuf::new());
    Scenario::parse(
        "x.toml",
        text.to_owned(),
        &sets,
        &Registry::builtin(),
        files,
    )
}

/// The message of a text that is wrong when it is read or when it is built.
fn refused(text: &str, sets: &[&str]) -> String {
    let built = parse(text, sets).and_then(|scenario| scenario.assemble().map(|_| ()));
    built.expect_err("refused").to_string()
}

#[track_caller]
fn check(text: &str, starts: &str, holds: &[&str]) {
    let message = refused(text, &[]);
    assert!(message.starts_with(starts), "{message}");
    for part in holds {
        assert!(message.contains(part), "{part:?} is not in {message}");
    }
}

#[test]
fn mistakes_have_a_place_and_the_nearest_name() {
    let team = "system = 'network'\n[team]\nrovrs = 5\n";
    check(
        team,
        "x.toml:3:1: ",
        &["\"rovrs\" in team", "did you mean \"rovers\"?"],
    );
    check(
        "system = 'netwrk'",
        "x.toml:1:10: ",
        &["did you mean \"network\"?"],
    );
    check(
        "system = 'network'\nlniks = 3",
        "x.toml:2:1: ",
        &["did you mean \"links\"?"],
    );
    let priority = "system = 'network'\nnetwork.priority = 'lowest_di'";
    check(
        priority,
        "x.toml:2:20: network.max_plus.priority: ",
        &["did you mean \"lowest_id\"?"],
    );
    let map = "system = 'network'\nworld.roadmap = 'crater-dens'";
    check(
        map,
        "x.toml:2:17: world.roadmap: ",
        &["did you mean \"crater-dense\"?"],
    );
    let link = "system = 'network'\nlinks.'rovr_*-node_*' = { loss = 1 }";
    check(link, "x.toml:2:25: ", &["did you mean \"rover_*-node_*\"?"]);
    let crash = "system = 'network'\n[[crash]]\nactor = 'node_3'\nat = '1s'";
    check(
        crash,
        "x.toml:3:9: crash.0.actor: ",
        &["did you mean \"node_03\"?"],
    );
}

#[test]
fn wrong_units_types_and_ranges_are_refused_where_they_stand() {
    let latency = "system = 'network'\n[links.default]\nlatency = 5";
    check(
        latency,
        "x.toml:3:11: links.default.latency: 5: ",
        &["has no unit"],
    );
    let loss = "system = 'network'\n[links.default]\nloss = 1.5";
    check(loss, "x.toml:3:8: ", &["from 0 to 1"]);
    let rovers = "system = 'network'\nteam.rovers = 'many'";
    check(
        rovers,
        "x.toml:2:15: ",
        &["expected a whole number from 0 on"],
    );
    check(
        "system = 'network'\nworld.nodes = 500",
        "x.toml:2:15: ",
        &["1 to 228 nodes"],
    );
    check(
        "system = 'network'\nteam.rovers = 0",
        "x.toml:2:15: ",
        &["expected 1 to"],
    );
    check(
        "system = 'network'\nteam = 3",
        "x.toml:2:8: team: ",
        &["expected a table"],
    );
    let times = "system = 'network'\n[[degrade]]\nat='5s'\nuntil='3s'\nlinks='*'\nloss=1";
    check(
        times,
        "x.toml:4:7: degrade.0.until: ",
        &["expected a time after \"5s\""],
    );
    let missing = "system = 'network'\n[[degrade]]\nat='5s'";
    check(
        missing,
        "x.toml:2:1: degrade.0: ",
        &["the key `links` is missing"],
    );
    let restart = "system = 'network'\n[[crash]]\nactor='node_01'\nat='5s'\nrestart='5s'";
    check(
        restart,
        "x.toml:5:9: crash.0.restart: ",
        &["after the crash at 5s"],
    );
    let never = "system = 'network'\n[[crash]]\nactor='node_01'\nat='10000000000s'\n";
    for key in ["restart_after", "within"] {
        check(
            &format!("{never}{key}='10000000000s'"),
            &format!("x.toml:5:{}: crash.0.{key}: ", key.len() + 2),
            &["expected a time on the clock, which ends at 18446744073.709551615s"],
        );
    }
}

#[test]
fn mistakes_in_links_have_a_place_and_the_nearest_name() {
    let default = |line: &str| format!("system = 'network'\n[links.default]\n{line}");
    let degrade =
        |line: &str| format!("system = 'network'\n[[degrade]]\nat = '5s'\nlinks = '*'\n{line}");
    let pattern = |line: &str| format!("system = 'network'\n[links.'node_*-*']\n{line}");
    for (line, column, parts) in [
        (
            "store_and_foward = true",
            1,
            &["did you mean \"store_and_forward\"?"][..],
        ),
        ("retrys = 3", 1, &["did you mean \"retries\"?"]),
        (
            "preset = 'mars-realy'",
            10,
            &["did you mean \"mars-relay\"?", "subsurface-mesh"],
        ),
        ("jitter_shape = 'parteo'", 16, &["did you mean \"pareto\"?"]),
        (
            "jitter_shape = { table = [1, 0] }",
            16,
            &["none is below the one before"],
        ),
        ("rate = 128", 8, &["a bare number has no unit"]),
        ("rate = '0bit/s'", 8, &["more than that"]),
        (
            "tx_power = '5m'",
            12,
            &["\"m\" is none of its units uW, mW, W, kW"],
        ),
        ("queue = -1", 9, &["a number of messages from 0 on"]),
        ("retries = 100000", 11, &["at most 1000"]),
        (
            "burst = { loss = 0.1, lenght = '4ms' }",
            23,
            &["did you mean \"length\"?"],
        ),
        ("burst = { loss = 0.1 }", 9, &["the mean length of a burst"]),
        ("burst = 3", 9, &["expected a table"]),
        (
            "contacts = [{ start = '5s', end = '3s' }]",
            12,
            &["an end after its start"],
        ),
        ("trace = [5, 3]", 9, &["3 ms after 5 ms"]),
    ] {
        let checks = [(default(line), 3), (pattern(line), 3), (degrade(line), 5)];
        for (text, row) in checks {
            check(&text, &format!("x.toml:{row}:{column}: "), parts);
        }
    }
    let twice = default("delay = '5ms'\nlatency = '6ms'");
    check(
        &twice,
        "x.toml:4:1: ",
        &["`delay` and `latency` are names of one key, `latency`"],
    );
    // The same from two places.
    let delay = default("delay = '5ms'");
    let error = parse(&delay, &["links.default.latency=6ms"]).err().unwrap();
    let told = error.to_string();
    assert!(
        told.starts_with("--set links.default.latency=6ms: "),
        "{told}"
    );
    assert!(
        told.contains("`delay` and `latency` are names of one key"),
        "{told}"
    );
}

#[test]
fn every_parameter_of_links_can_be_set() {
    let text = Registry::builtin()
        .scenario("network/crater-dense")
        .unwrap();
    let sets = [
        "links.default.preset=mars-relay",
        "links.default.contacts=off",
        "links.default.burst={ loss = 0.1, length = '40ms' }",
        "links.default.burst.loss=0.2",
        "links.default.limit=20",
        "links.default.distribution=normal",
        "links.*-rover_01.preset=perfect",
        "links.*-rover_01.rate=1Mbit/s",
        "degrade=[{ at = '2s', links = 'node_*-*', preset = 'subsurface-mesh', fifo = true }]",
    ];
    let scenario = parse(text, &sets).unwrap();
    let links = &scenario.shared().links;
    assert_eq!(links.default.rate, Some(128_000));
    assert_eq!(links.default.contacts, None);
    assert!((links.default.burst.as_ref().unwrap().mean_loss() - 0.2).abs() < 1e-9);
    let resolved = scenario.resolved().unwrap();
    let again = parse(&resolved, &[]).unwrap();
    assert_eq!(again.shared(), scenario.shared());
    scenario.assemble().unwrap();
}

#[test]
fn every_preset_carries_traffic() {
    let text = Registry::builtin().scenario("traffic/open-loop").unwrap();
    for name in Preset::names() {
        let preset = format!("links.default.preset={name}");
        let scenario = parse(text, &["until=30min", &preset, "links.default.tx_power=1W"]).unwrap();
        let report = scenario
            .assemble()
            .unwrap()
            .sim
            .run(Executor::Inline)
            .unwrap();
        assert!(report.counts.delivered > 0, "{name}");
    }
}

#[test]
fn links_follow_the_plan_and_the_trace() {
    let text = Registry::builtin()
        .scenario("traffic/contact-plan")
        .unwrap();
    let lost = |sets: &[&str]| {
        let scenario = parse(text, &[&["until=6h"], sets].concat()).unwrap();
        let counts = scenario.assemble().unwrap().sim.run(Executor::Inline);
        let counts = counts.unwrap().counts;
        (counts.delivered, counts.lost_by_reason)
    };
    let unheld = "links.default.store_and_forward=false";
    let (planned, reasons) = lost(&[unheld]);
    assert!(planned > 0 && reasons["no_contact"] > 0, "{reasons:?}");
    let (held, reasons) = lost(&[]);
    assert!(
        held > planned && !reasons.contains_key("no_contact"),
        "{reasons:?}"
    );
    // What `[links]` says is above the plan.
    let open = "links.*.contacts=off";
    let (free, reasons) = lost(&[open]);
    assert!(free > held && reasons.is_empty(), "{reasons:?}");
    let (traced, _) = lost(&[open, "links.*.trace=rover-radio", "links.*.queue=0"]);
    assert!(traced > planned && traced <= free);
    let message = refused(text, &["links.default.trace=rover-raido"]);
    assert!(
        message.starts_with("--set links.default.trace=rover-raido: "),
        "{message}"
    );
    assert!(
        message.contains("did you mean \"rover-radio\"?"),
        "{message}"
    );
}

#[test]
fn a_set_is_blamed_by_name() {
    let text = Registry::builtin()
        .scenario("network/crater-dense")
        .unwrap();
    for (set, part) in [
        ("links.default.loss=1.5", "from 0 to 1"),
        ("links.defualt.loss=0.5", "did you mean \"default\"?"),
        ("links.default.los=0.5", "did you mean \"loss\"?"),
        ("links.default.burst.loss=0.5", "the mean length of a burst"),
        ("links.default.preset=moon", "expected one of perfect"),
        ("team.rovers=0", "expected 1 to"),
        ("world.nodes=229", "1 to 228"),
        ("tame.rovers=5", "did you mean \"team\"?"),
    ] {
        let message = refused(text, &[set]);
        assert!(message.starts_with(&format!("--set {set}: ")), "{message}");
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn a_resolved_scenario_gives_the_same_run() {
    let text = Registry::builtin()
        .scenario("network/crater-dense")
        .unwrap();
    let sets = [
        "team.rovers=4",
        "links.rover_*-node_*.loss=0.2",
        "links.*-rover_01.latency=9ms",
        "degrade=[{ at = '2s', until = '4s', links = 'node_*-*', outage = true }]",
        "crash=[{ actor = 'node_03', at = '1s', restart = '3s' }]",
        "world.radius=150m",
    ];
    let mut first = parse(text, &sets).unwrap();
    first.set_seed(7);
    first.set_until(SimDuration::from_secs(6));
    let resolved = first.resolved().unwrap();
    let second = parse(&resolved, &[]).unwrap();
    assert_eq!(second.shared(), first.shared());
    assert_eq!(second.resolved().unwrap(), resolved);
    let run = |scenario: &Scenario| scenario.assemble().unwrap().sim.run(Executor::Inline);
    let (a, b) = (run(&first).unwrap(), run(&second).unwrap());
    assert_eq!(a.digest, b.digest);
    assert!(a.counts.lost_by_reason["outage"] > 0 && a.counts.lost_by_reason["crashed"] > 0);
}

#[test]
fn built_in_scenarios_are_whole() {
    let registry = Registry::builtin();
    for name in registry.scenario_names() {
        let scenario = Scenario::open(name, &[], &registry).unwrap();
        assert!(!scenario.shared().description.is_empty());
        assert_eq!(scenario.name(), name);
        scenario.assemble().unwrap();
    }
}

#[test]
fn any_text_gives_a_scenario_or_an_error() {
    let text = Registry::builtin()
        .scenario("network/crater-dense")
        .unwrap();
    for end in (0..text.len()).step_by(3) {
        let _ = parse(&text[..end], &[]);
    }
    for rubbish in [
        "\0",
        "[[[[",
        "a = [1,",
        "system = 1",
        "[system]",
        "\u{feff}",
        "=",
        "system",
    ] {
        assert!(parse(rubbish, &[]).is_err(), "{rubbish:?}");
        let _ = parse("system = 'network'", &[rubbish]);
        let _ = parse(
            "system = 'network'",
            &[&format!("links.x.{rubbish}={rubbish}")],
        );
    }
}

#[cfg(unix)]
#[test]
fn what_is_no_file_is_not_waited_for() {
    // One of those that never end; from a pipe nothing may ever come.
    let error = Scenario::open("/dev/zero", &[], &Registry::builtin()).err();
    let text = error.unwrap().to_string();
    assert!(text.contains("it is no regular file"), "{text}");
    let text = Files::on_disk(PathBuf::new())
        .read("/dev/zero", 10)
        .unwrap_err();
    assert!(text.contains("it is no regular file"), "{text}");
}

#[test]
fn a_flow_that_would_fill_the_memory_is_refused() {
    let text = |period: &str, stop: &str| {
        format!(
            "system = 'traffic'\nuntil = '1h'\ntraffic.hosts = ['a', 'b']\n[[traffic.flow]]\n\
             from = 'a'\nto = 'b'\nstart = '59min'\nperiod = '{period}'\n{stop}"
        )
    };
    let message = refused(&text("1ns", ""), &[]);
    assert!(
        message.starts_with("x.toml:8:10: traffic.flow.0.period: 1ns: "),
        "{message}"
    );
    assert!(message.contains("60000000000 in"), "{message}");
    for (period, stop) in [("1us", ""), ("1ns", "stop = '3540000001us'")] {
        parse(&text(period, stop), &[]).unwrap().assemble().unwrap();
    }
}

#[test]
fn what_begins_when_the_run_is_over_is_remarked_on() {
    let text = "system = 'network'\nuntil = '60s'\n\
                [[degrade]]\nat = '59s'\nlinks = '*'\nloss = 1\n\
                [[degrade]]\nat = '60s'\nlinks = '*'\nloss = 1\n\
                [[crash]]\nactor = 'node_03'\nat = '2h'\n";
    let remarks = parse(text, &[]).unwrap().assemble().unwrap().remarks;
    let expected = [
        "degrade.1 is never reached: it begins at 60s, and the run ends at 60s at the latest",
        "crash.0 is never reached: it is at 7200s, and the run ends at 60s at the latest",
    ];
    assert_eq!(remarks, expected);
    let endless = parse(&text.replace("until = '60s'", ""), &[]).unwrap();
    assert!(endless.assemble().unwrap().remarks.is_empty());
}

#[test]
fn keys_that_moved_to_tables_of_their_policies_are_read_where_they_were() {
    let open = |text: &str, sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
        let files = Files::on_disk(PathBuf::new());
        Scenario::parse(
            "x.toml",
            text.to_owned(),
            &sets,
            &Registry::builtin(),
            files,
        )
    };
    let resolved = |text: &str, sets: &[&str]| open(text, sets).unwrap().resolved().unwrap();
    let new = "system = 'network'\nnetwork.max_plus.damping = 0.5\nnetwork.complete.routes = 3";
    let old = "system = 'network'\nnetwork.damping = 0.5\nnetwork.routes = 3";
    assert_eq!(resolved(old, &[]), resolved(new, &[]));
    let bare = "system = 'network'\n";
    assert_eq!(
        resolved(bare, &["network.damping=0.5", "network.routes=3"]),
        resolved(new, &[])
    );
    let assembled = open(old, &[]).unwrap().assemble().unwrap();
    let remark = "network.damping is called network.max_plus.damping now";
    assert!(assembled.remarks.iter().any(|found| found == remark));
    let both = open(&format!("{new}\nnetwork.routes = 4"), &[]);
    let both = both.err().expect("it is refused").to_string();
    assert!(
        both.contains("x.toml:4:18: network.routes: this is"),
        "{both}"
    );
    let zero = open(&format!("{bare}network.routes = 0"), &[]);
    let zero = zero.err().expect("it is refused").to_string();
    let expected = "x.toml:2:18: network.complete.routes: 0: expected 1 to 100";
    assert!(zero.contains(expected), "{zero}");
}
