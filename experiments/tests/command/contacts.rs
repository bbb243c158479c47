//! Contact plans of scenarios: what `check` tells of them, and what it refuses.

use std::path::Path;

use crate::common::{farside, json, text};

const SCENARIO: &str = "
system = 'traffic'
until = '1h'
traffic.hosts = ['earth', 'orbiter', 'rover_1']
traffic.flow = [{ from = 'rover_1', to = 'orbiter', period = '1min' }]
";

const PLAN: &str = "
a range   +0   +3600  1 2  0.25
a contact +60  +540   1 2  16000
a contact +600 +660   1 2  16000
a contact +60  +540   2 1  1000
a contact +0   +3600  1 1  1000
";

/// Checks the scenario with this `[contacts]` table and this plan.
fn check(folder: &Path, contacts: &str, plan: &str) -> (Option<i32>, String, String) {
    let scenario = format!("{SCENARIO}\n[contacts]\n{contacts}\n");
    std::fs::write(folder.join("mine.toml"), scenario).unwrap();
    std::fs::write(folder.join("plan.txt"), plan).unwrap();
    let output = farside(folder, &["check", "mine.toml"]);
    let (out, error) = (text(&output.stdout), text(&output.stderr));
    (output.status.code(), out.to_owned(), error.to_owned())
}

const NODES: &str = "nodes = { 1 = 'rover_1', 2 = 'orbiter' }";

#[test]
fn a_checked_plan_is_told_in_comments() {
    let folder = tempfile::tempdir().unwrap();
    let contacts = format!("file = 'plan.txt'\noffset = '1min'\n{NODES}");
    let (code, out, error) = check(folder.path(), &contacts, PLAN);
    assert_eq!(code, Some(0), "{error}");
    let notes = "\n# contacts: \"plan.txt\", read as ION
#   3 contacts of 2 ordered pairs from 120s to 720s: 9120000 bytes in all
#   orbiter -> rover_1: 1 contact, 480000 bytes, open for 480s, longest gap 120s from 600s
#   rover_1 -> orbiter: 2 contacts, 8640000 bytes, open for 540s, longest gap 60s from 600s
#   of no use, for want of a link (1): orbiter -> rover_1\n";
    assert!(out.ends_with(notes), "{out}");
    // What was printed is the scenario still.
    let resolved: toml::Table = out.parse().unwrap();
    assert_eq!(resolved["contacts"]["offset"].as_str(), Some("60s"));
    std::fs::write(folder.path().join("again.toml"), &out).unwrap();
    let again = farside(folder.path(), &["check", "again.toml"]);
    assert_eq!(text(&again.stdout), out);
}

#[test]
fn nodes_that_are_no_hosts_are_refused_by_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let says = |contacts: &str, plan: &str, message: &str| {
        let (code, _, error) = check(folder.path(), contacts, plan);
        assert_eq!(code, Some(2));
        assert!(error.contains(message), "{error}");
    };
    let named = PLAN
        .replace(" 1 2 ", " rover_2 2 ")
        .replace(" 2 1 ", " 2 rover_2 ");
    let named = named.replace(" 1 1 ", " rover_2 rover_2 ");
    let message = "plan.txt: line 2: node \"rover_2\" is no host; did you mean \"rover_1\"?";
    says(
        "file = 'plan.txt'\nnodes = { 2 = 'orbiter' }",
        &named,
        message,
    );
    let message =
        "mine.toml:9:15: contacts.nodes.1: \"orbitr\" is no host; did you mean \"orbiter\"?";
    says(
        "file = 'plan.txt'\nnodes = { 1 = 'orbitr', 2 = 'earth' }",
        PLAN,
        message,
    );
    let message = "contacts.nodes.3: the plan has no node \"3\": expected one of 1, 2";
    says("file = 'plan.txt'\nnodes = { 3 = 'earth' }", PLAN, message);
    let message = "contacts.nodes.2: \"earth\" is node 1 already";
    says(
        "file = 'plan.txt'\nnodes = { 1 = 'earth', 2 = 'earth' }",
        PLAN,
        message,
    );
    // A node that has a host's name is that host.
    let named = named.replace("rover_2", "rover_1");
    let (code, _, error) = check(
        folder.path(),
        "file = 'plan.txt'\nnodes = { 2 = 'earth' }",
        &named,
    );
    assert_eq!(code, Some(0), "{error}");
}

#[test]
fn plans_that_cannot_be_are_refused_by_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let says = |contacts: &str, plan: &str, message: &str| {
        let contacts = format!("{contacts}\n{NODES}");
        let (code, _, error) = check(folder.path(), &contacts, plan);
        assert_eq!(code, Some(2));
        assert!(error.contains(message), "{error}");
    };
    let overlap = PLAN.replace("+600", "+500");
    let message = "mine.toml:8:8: contacts.file: plan.txt: line 4: the contact from 1 to 2 overlaps that of line 3";
    says("file = 'plan.txt'", &overlap, message);
    let message = "plan.txt: line 1, column 1: not an HDTN contact plan";
    says("file = 'plan.txt'\nformat = 'hdtn'", PLAN.trim(), message);
    says("file = 'mars-realy'", PLAN, "did you mean \"mars-relay\"?");
    says("file = 'none.txt'", PLAN, "none.txt: cannot read it");
    says(
        "file = 'plan.txt'\noffset = '213503.98d'",
        PLAN,
        "more than 584 years",
    );
    says(
        "file = 'plan.txt'\nofset = '1s'",
        PLAN,
        "did you mean \"offset\"?",
    );
    says("file = 'plan.txt'\nformat = 'csv'", PLAN, "csv");
}

#[test]
fn a_plan_of_ones_own_travels_in_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let contacts = format!("file = 'plan.txt'\n{NODES}");
    assert_eq!(check(folder.path(), &contacts, PLAN).0, Some(0));
    let run = farside(folder.path(), &["run", "mine.toml", "--json"]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    assert!(json(&run)["messages"]["sent"].as_u64().unwrap() > 0);
    std::fs::remove_file(folder.path().join("plan.txt")).unwrap();
    let verified = farside(folder.path(), &["verify", "run.mcap"]);
    assert_eq!(
        verified.status.code(),
        Some(0),
        "{}",
        text(&verified.stderr)
    );
}
