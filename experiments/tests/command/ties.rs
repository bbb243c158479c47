//! Which conclusions hang on the order of simultaneous events.

use std::path::Path;

use serde_json::{Value, json};

use crate::common::{farside, json as read, text};

/// Two hosts send at the same instants over a relay; behind it is a link of this kind.
fn write(folder: &Path, name: &str, link: &str) {
    let text = format!(
        "system = 'traffic'\nuntil = '9s'\n[traffic]\nhosts = ['a', 'b', 'relay', 'earth']\nflow = [\n\
         {{ from = 'a', to = 'earth', via = ['relay'], size = '100B', period = '1s', stop = '3s' }},\n\
         {{ from = 'b', to = 'earth', via = ['relay'], size = '1000B', period = '1s', stop = '3s' }}]\n\
         [links.default]\nlatency = '100ms'\n[links.relay-earth]\n{link}\n"
    );
    std::fs::write(folder.join(name), text).unwrap();
}

fn ties(folder: &Path, arguments: &[&str]) -> (Option<i32>, Value) {
    let output = farside(folder, &[&["ties", "--json"][..], arguments].concat());
    assert!(output.status.code() < Some(2), "{}", text(&output.stderr));
    (output.status.code(), read(&output))
}

#[test]
fn nothing_changes_where_nobody_waits_for_another() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "free.toml", "loss = 0.3");
    let (code, told) = ties(folder.path(), &["free.toml", "--seeds", "6"]);
    assert_eq!((code, &told["changed"]), (Some(0), &json!([])), "{told}");
    assert_eq!(told["parting"], Value::Null);
    assert_eq!(told["tie_seeds"], json!([null, 1, 2, 3, 4, 5, 6]));
    // The events went in other orders all the same.
    assert!(told["digests"].as_u64() > Some(1), "{told}");
    let said = farside(folder.path(), &["ties", "free.toml", "--seeds", "2"]);
    let said = text(&said.stdout);
    assert!(said.ends_with("conclusions changes\n"), "{said}");
}

#[test]
fn two_messages_at_one_instant_that_decide_are_named() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "slow.toml", "rate = '8kbit/s'");
    let (code, told) = ties(folder.path(), &["slow.toml", "--seeds", "6"]);
    assert_eq!(code, Some(1), "{told}");
    let changed = told["changed"].as_array().unwrap();
    let mean = changed.iter().find(|one| one["name"] == "delay_mean_s");
    let mean = mean.unwrap_or_else(|| panic!("{told}"));
    // 100 bytes take 0.1 s and 1000 bytes 1 s on the slow link, and whoever comes first is served first.
    // By name the small ones are: the least mean of all orders.
    let held = mean["values"].as_array().unwrap();
    let seeds = |held: &Value| held["tie_seeds"].as_array().unwrap().clone();
    assert_eq!(seeds(&held[0])[0], Value::Null, "{mean}");
    assert_eq!(held.iter().map(|held| seeds(held).len()).sum::<usize>(), 7);
    assert!(mean["min"].as_f64() < mean["median"].as_f64(), "{mean}");
    // The same by another way: one run at a time.
    for (held, seed) in held
        .iter()
        .flat_map(|held| seeds(held).into_iter().map(move |s| (held, s)))
    {
        let seed = seed.as_u64().map(|seed| seed.to_string());
        let mut arguments = vec!["run", "slow.toml", "--no-log", "--json"];
        arguments.extend(seed.iter().flat_map(|seed| ["--tie-seed", seed]));
        let run = read(&farside(folder.path(), &arguments));
        let [one, all] = [&run["metrics"]["delay_mean_s"], &held["value"]].map(Value::as_f64);
        assert!((one.unwrap() - all.unwrap()).abs() < 1e-8, "{seed:?}");
    }
    let (tie, event) = (&told["parting"]["tie"], &told["parting"]["event"]);
    assert_eq!(
        (&tie["at"], &tie["time_ns"]),
        (&json!("relay"), &json!(100_000_000))
    );
    let pair = [&tie["first"], &tie["then"]].map(|id| id.as_str().unwrap());
    assert!(pair[0].starts_with("a,relay,Datagram,") && pair[1].starts_with("b,relay,Datagram,"));
    assert_eq!(
        (&event["actor"], &event["field"]),
        (&json!("relay"), &json!("fate"))
    );
    assert_eq!(event["a"], "delivered at 0.300000 s");
    assert_eq!(event["b"], "delivered at 1.300000 s");
}

#[test]
fn any_number_of_jobs_says_the_same() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "slow.toml", "rate = '8kbit/s'");
    let with = |jobs: &str| {
        ties(
            folder.path(),
            &["slow.toml", "--seeds", "9", "--jobs", jobs],
        )
    };
    assert_eq!(with("1"), with("4"));
}

#[test]
fn the_scenario_of_a_log_is_run_with_its_own_tie_seed_first() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "slow.toml", "rate = '8kbit/s'");
    let run = farside(folder.path(), &["run", "slow.toml", "--tie-seed", "3"]);
    assert_eq!(run.status.code(), Some(0));
    std::fs::remove_file(folder.path().join("slow.toml")).unwrap();
    let (_, told) = ties(folder.path(), &["run.mcap", "--seeds", "4"]);
    assert_eq!(told["tie_seeds"], json!([3, 1, 2, 4]));
    assert_eq!(told["parting"]["tie_seeds"][0], 3, "{told}");
    let set = [
        "run.mcap",
        "--seeds",
        "4",
        "--set",
        "until='50ms'",
        "--seed",
        "7",
    ];
    let (code, told) = ties(folder.path(), &set);
    assert_eq!((code, &told["seed"]), (Some(0), &json!(7)), "{told}");
    for (arguments, said) in [
        (&["ties", "nowhere"][..], "nowhere"),
        (&["ties", "run.mcap", "--seeds", "0"], "0"),
        (&["ties", "run.mcap", "--set", "traffic.flw=[]"], "flow"),
    ] {
        let refused = farside(folder.path(), arguments);
        assert_eq!(refused.status.code(), Some(2));
        assert!(text(&refused.stderr).contains(said), "{arguments:?}");
    }
}

#[test]
fn a_fork_says_which_degradations_no_message_met() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "slow.toml", "rate = '8kbit/s'");
    let run = farside(folder.path(), &["run", "slow.toml"]);
    assert_eq!(run.status.code(), Some(0));
    let remarks = |degrade: &str| {
        let set = format!("degrade=[{degrade}]");
        let arguments = [
            "fork", "run.mcap", "--at", "1s", "--set", &set, "--out", "f.mcap", "--json",
        ];
        let forked = farside(folder.path(), &arguments);
        assert!(forked.status.code() < Some(2), "{}", text(&forked.stderr));
        read(&forked)["remarks"].to_string()
    };
    // Hosts send at 0 s, 1 s and 2 s.
    let idle = remarks("{ at = '1500ms', until = '1900ms', links = 'a-relay', loss = 0.5 }");
    assert!(
        idle.contains(
            "degrade.0 applied to no message: none was sent over a-relay from 1.5s to 1.9s"
        ),
        "{idle}"
    );
    let met = remarks("{ at = '1500ms', until = '2100ms', links = 'a-relay', loss = 0.5 }");
    assert!(!met.contains("applied to no message"), "{met}");
}
