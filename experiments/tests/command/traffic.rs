//! Open-loop traffic from the command line: what it reports, and that it is the same every way.

use crate::common::{farside, json, text};

#[test]
fn traffic_is_the_same_on_every_executor_and_from_its_log() {
    let folder = tempfile::tempdir().unwrap();
    let run = |more: &[&str]| {
        let arguments = [&["run", "traffic/open-loop", "--json"], more].concat();
        let output = farside(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        json(&output)
    };
    let kameo = run(&["--threads", "3"]);
    let inline = run(&["--executor", "inline", "--no-log"]);
    assert_eq!(kameo["digest"], inline["digest"]);
    assert_eq!(kameo["metrics"], inline["metrics"]);
    let verified = farside(folder.path(), &["verify", "run.mcap"]);
    assert_eq!(
        verified.status.code(),
        Some(0),
        "{}",
        text(&verified.stdout)
    );

    let metrics = &inline["metrics"];
    let number = |name: &str| metrics[name].as_f64().unwrap();
    assert_eq!(number("flows"), 12.0);
    assert_eq!(
        number("sent"),
        number("delivered") + number("lost") + number("in_flight")
    );
    assert!(number("delivery_ratio") > 0.95 && number("delay_p50_s") < number("delay_p95_s"));
    assert!(number("age_of_information_mean_s") < number("age_peak_s"));
    let delays = metrics["delays_s"].as_array().unwrap();
    assert_eq!(delays.len() as f64, number("delivered"));
}

#[test]
fn more_loss_sends_the_same_and_delivers_less() {
    let folder = tempfile::tempdir().unwrap();
    let run = |loss: &str| {
        let set = format!("links.default.loss={loss}");
        let arguments = [
            "run",
            "traffic/open-loop",
            "--json",
            "--no-log",
            "--set",
            &set,
        ];
        json(&farside(folder.path(), &arguments))["metrics"].clone()
    };
    let (few, many) = (run("0.1"), run("0.4"));
    assert_eq!(few["sent"], many["sent"]);
    assert!(few["delivered"].as_u64() > many["delivered"].as_u64());
}

#[test]
fn mistakes_name_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let check = |text: &str| {
        std::fs::write(folder.path().join("mine.toml"), text).unwrap();
        let output = farside(folder.path(), &["check", "mine.toml"]);
        assert_eq!(output.status.code(), Some(2));
        String::from_utf8(output.stderr).unwrap()
    };
    let start = "system = 'traffic'\ntraffic.hosts = ['rover', 'base']\n[[traffic.flow]]\n";
    let nobody = check(&format!(
        "{start}from = 'rover'\nto = 'bsae'\nperiod = '1s'\nstop = '9s'"
    ));
    let place =
        "mine.toml:5:6: traffic.flow.0.to: \"bsae\" matches no host; did you mean \"base\"?";
    assert!(nobody.contains(place), "{nobody}");
    let endless = check(&format!(
        "{start}from = 'rover'\nto = 'base'\nperiod = '1s'"
    ));
    assert!(endless.contains("it would never end"), "{endless}");
    let misspelt = check(&format!(
        "{start}form = 'rover'\nto = 'base'\nperiod = '1s'"
    ));
    assert!(misspelt.contains("did you mean \"from\"?"), "{misspelt}");
    let empty = check("system = 'traffic'");
    assert!(
        empty.contains("traffic.hosts: fewer than two hosts"),
        "{empty}"
    );
}
