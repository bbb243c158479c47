//! What is refused before anything runs, and how it is said.

use super::super::results::Results;
use super::super::store::Store;
use super::super::{Interrupts, Shard, StudyError};
use super::toy::{Toy, plan, plan_with, study};
use super::{GRID, STOP, options, run, run_all};

/// The message of a study that is refused when it is planned.
pub(super) fn refused(text: &str) -> String {
    let toy = Toy::new();
    match plan_with(&toy, text, None) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("not refused:\n{text}"),
    }
}

#[track_caller]
pub(super) fn check(more: &str, starts: &str, holds: &str) {
    let message = refused(&study(more));
    assert!(message.starts_with(starts), "{message}");
    assert!(message.contains(holds), "{holds:?} is not in {message}");
}

const FACTOR: &str = "[[factor]]\nname = 'level'\nkey = 'toy.level'\n";

#[test]
fn plots_are_of_factors_each_in_one_place() {
    let report = |keys: &str| format!("{GRID}[report]\n{keys}\n");
    let check_report = |keys: &str, key: &str, holds: &str| {
        let message = refused(&study(&report(keys)));
        assert!(
            message.starts_with("x.toml:") && message.contains(key),
            "{message}"
        );
        assert!(message.contains(holds), "{holds:?} is not in {message}");
    };
    check_report("x = 'levle'", "report.x", "did you mean \"level\"?");
    check_report("x = 'nothing'", "report.x", "one of level, delay");
    check_report(
        "x = 'delay'\nfacet = 'delay'",
        "report.facet",
        "is x already",
    );
    check_report("facets = 'delay'", "", "did you mean \"facet\"?");
    // How results are plotted is no part of what was run.
    let (toy, text) = (Toy::new(), study(GRID));
    let done = run_all(&toy, &text, &options(&toy, "out", 1));
    let text = study(&report("x = 'delay'"));
    let again = run_all(&toy, &text, &options(&toy, "out", 1));
    assert_eq!(again.runs, done.runs);
    assert_eq!(again.manifest.report.x.as_deref(), Some("delay"));
}

#[test]
fn a_mistake_in_a_factor_is_said_where_it_stands() {
    let one = |rest: &str| format!("{FACTOR}{rest}\n");
    check("", "x.toml:1:1: factor: ", "no [[factor]]");
    check("sets = 3", "x.toml:4:1: ", "did you mean \"set\"?");
    check(
        &one("values = []"),
        "x.toml:7:10: factor.0.values",
        "at least one value",
    );
    check(
        &one("vlaues = []"),
        "x.toml:7:1: ",
        "did you mean \"values\"?",
    );
    check(
        &one("values = [1, 1.0]"),
        "x.toml:7:10: ",
        "1.0 is there twice",
    );
    check(&one("values = [1, 'x']"), "x.toml:7:10: ", "the same sort");
    check(
        &one("values = [0, 1]\nscale = 'log'"),
        "x.toml:7:10: ",
        "more than zero",
    );
    check(
        &one("range = [0, 1]"),
        "x.toml:4:1: factor.0: ",
        "needs steps",
    );
    check(
        &one("range = [0, 1]\nsteps = 5"),
        "x.toml:8:9: ",
        "is there twice",
    );
    check(
        &one("range = [1, 0]\nsteps = 5"),
        "x.toml:7:9: ",
        "lower end first",
    );
    check(
        &one("values = [1]\nsteps = 5"),
        "x.toml:8:9: ",
        "only a range",
    );
    check(
        &one("values = ['1s']\nunit = 'ms'"),
        "x.toml:8:8: ",
        "counted in s",
    );
    check(&one(""), "x.toml:4:1: ", "no values");
    let twice = one("values = [1]").repeat(2);
    check(
        &twice,
        "x.toml:9:8: factor.1.name",
        "another factor has this name",
    );
    let same_key = twice.replacen("name = 'level'", "name = 'other'", 1);
    check(
        &same_key,
        "x.toml:10:7: factor.1.key",
        "another factor sets this key",
    );
    let keyless = "[[factor]]\nname = 'a'\nvalues = [1]";
    check(keyless, "x.toml:4:1: factor.0: ", "no key");
    let seed = "[[factor]]\nname = 'a'\nkey = 'seed'\nvalues = [1]";
    check(seed, "x.toml:6:7: ", "by its own key, seeds");
}

#[test]
fn what_the_scenario_refuses_is_said_where_the_study_sets_it() {
    let values = format!("{FACTOR}values = [1, -1]\n");
    check(
        &values,
        "x.toml:7:14: factor level = -1: ",
        "no less than 0",
    );
    let unknown = "[[factor]]\nname = 'l'\nkey = 'toy.levle'\nvalues = [1]";
    check(
        unknown,
        "x.toml:7:11: factor l = 1: ",
        "did you mean \"level\"?",
    );
    let set = format!("[set]\ntoy.level = 'high'\n{FACTOR}values = [1]");
    // The factor lays its own value over it later; what is set must be right all the same.
    check(&set, "x.toml:5:13: toy.level=high: ", "expected a number");
    let quoted = format!("[set]\n'toy.lvl' = 3\n{FACTOR}values = [1]");
    check(
        &quoted,
        "x.toml:5:13: toy.lvl=3: ",
        "did you mean \"level\"?",
    );
    let scenario = study(&format!("{FACTOR}values = [1]")).replace("toy.toml", "toy/plian");
    let message = refused(&scenario);
    assert!(
        message.starts_with("x.toml:2:12: scenario: unknown value"),
        "{message}"
    );
    assert!(message.contains("did you mean \"toy/plain\"?"), "{message}");
}

#[test]
fn designs_seeds_baselines_and_stops_are_checked() {
    let with = |more: &str| format!("{more}\n{FACTOR}values = [1, 2]\n");
    check(&with("seeds = 0"), "x.toml:4:9: seeds", "from 1 to");
    check(
        &with("seeds = [1, 2, 1]"),
        "x.toml:4:9: seeds",
        "1 is there twice",
    );
    check(
        &with("seeds = 'many'"),
        "x.toml:4:9: seeds",
        "how many seeds",
    );
    check(
        &with("baseline = { level = 3 }"),
        "x.toml:4:12: baseline",
        "its values are 1, 2",
    );
    check(
        &with("baseline = { levl = 1 }"),
        "x.toml:4:12: baseline",
        "did you mean \"level\"?",
    );
    check(
        &with("design = 'gird'"),
        "x.toml:4:10: design",
        "did you mean \"grid\"?",
    );
    check(&with("cells = 3"), "x.toml:4:9: cells", "latin-hypercube");
    check(
        &with("design = 'list'"),
        "x.toml:8:10: factor.0.values",
        "[[cell]]",
    );
    let cells = format!("design = 'list'\n{FACTOR}[[cell]]\nlevle = 3\n");
    check(
        &cells,
        "x.toml:9:9: cell.0.levle",
        "did you mean \"level\"?",
    );
    let paired = "design = 'paired'\n".to_owned() + GRID;
    check(&paired, "x.toml:10:1: factor.1: ", "2 values");
    let stop = |key: &str, value: &str| {
        let lines = STOP.lines().map(|line| match line.split_once(" = ") {
            Some((name, _)) if name == key => format!("{key} = {value}\n"),
            _ => format!("{line}\n"),
        });
        lines.collect::<String>()
    };
    check(
        &stop("metric", "'vale'"),
        "x.toml:5:10: stop.metric",
        "did you mean \"value\"?",
    );
    check(&stop("width", "0"), "x.toml:6:9: stop.width", "above zero");
    check(
        &stop("min_seeds", "2"),
        "x.toml:7:13: stop.min_seeds",
        "at least 5",
    );
    check(
        &stop("max_seeds", "4"),
        "x.toml:8:13: stop.max_seeds",
        "from min_seeds, 5,",
    );
    check(
        &format!("seeds = 3\n{STOP}"),
        "x.toml:4:9: seeds",
        "max_seeds",
    );
}

#[test]
fn metrics_are_known_after_the_first_run() {
    let toy = Toy::new();
    let options = options(&toy, "out", 1);
    for (metrics, part) in [
        (
            "['vlaue']",
            "x.toml:3:12: metrics.0: unknown value \"vlaue\"; did you mean \"value\"?",
        ),
        (
            "['value', 'table']",
            "x.toml:3:21: metrics.1: unknown value \"table\"",
        ),
        ("['messages.lots']", "did you mean \"messages.lost\"?"),
    ] {
        let text = study(GRID).replace("['value', 'list']", metrics);
        let ended = run(
            plan(&toy, &text),
            &options,
            &Interrupts::default(),
            &mut |_| {},
        );
        let message = ended.unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
        assert!(!options.folder.exists(), "nothing is left behind");
    }
    for (metrics, part) in [
        ("[]", "x.toml:3:11: metrics: expected at least one"),
        ("['value', 'value']", "is there twice"),
        ("[{ name = 'value', unti = 's' }]", "did you mean \"unit\"?"),
    ] {
        let message = refused(&study(GRID).replace("['value', 'list']", metrics));
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn folders_of_something_else_are_left_alone() {
    let toy = Toy::new();
    let go = |text: &str, folder: &str| {
        let options = options(&toy, folder, 1);
        let ended = run(
            plan(&toy, text),
            &options,
            &Interrupts::default(),
            &mut |_| {},
        );
        ended.unwrap_err().to_string()
    };
    run_all(&toy, &study(GRID), &options(&toy, "mine", 1));
    let manifest = toy.path("mine").join("manifest.json");
    let before = std::fs::read_to_string(&manifest).unwrap();
    let other = study(GRID).replace("[1, 2, 3]", "[1, 2]");
    let message = go(&other, "mine");
    assert!(
        message.contains("holds other results: the cells"),
        "{message}"
    );
    let set = "set = { toy.fail_level = 3 }\n".to_owned() + GRID;
    let message = go(&study(&set), "mine");
    assert!(message.contains("fail_level = 0.0"), "{message}");
    for (from, to, part) in [
        (
            "\"format\": 1",
            "\"format\": 2",
            "format 2: this version reads and writes 1",
        ),
        ("\"0.1.0\"", "\"0.0.9\"", "code version \"0.0.9\" there"),
        (
            "\"cells\"",
            "\"sells\"",
            "not a study's manifest: unknown field `sells`",
        ),
    ] {
        std::fs::write(&manifest, before.replace(from, to)).unwrap();
        let message = go(&study(GRID), "mine");
        assert!(message.contains(part), "{message}");
    }
    std::fs::create_dir(toy.path("theirs")).unwrap();
    std::fs::write(toy.path("theirs").join("thesis.tex"), "").unwrap();
    let message = go(&study(GRID), "theirs");
    assert!(message.contains("it holds thesis.tex"), "{message}");
    let missing = Results::load(&toy.path("theirs")).unwrap_err().to_string();
    assert!(missing.contains("no manifest.json"), "{missing}");
}

#[test]
fn lines_that_are_whole_and_wrong_are_named() {
    let toy = Toy::new();
    let options = options(&toy, "mine", 1);
    run_all(&toy, &study(GRID), &options);
    let path = options.folder.join("runs.jsonl");
    let text = std::fs::read_to_string(&path).unwrap();
    let second = text.lines().nth(1).unwrap();
    for (line, part) in [
        ("{\"cell\":0", "runs.jsonl:2: not a record of a run"),
        ("", "runs.jsonl:2: not a record of a run"),
        (
            &second.replace("\"cell\":1", "\"cell\":6"),
            "runs.jsonl:2: cell 6: the last one is 5",
        ),
        (
            &second.replace("\"seed\":1", "\"seed\":7"),
            "seed 7: the study has no such seed",
        ),
    ] {
        std::fs::write(&path, text.replace(second, line)).unwrap();
        let message = Results::load(&options.folder).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
    let tampered = second.replace("\"value\":", "\"value\":1");
    std::fs::write(&path, format!("{text}{tampered}\n")).unwrap();
    let message = Results::load(&options.folder).unwrap_err().to_string();
    assert!(
        message.contains("cell 1, seed 1: two records of this run differ"),
        "{message}"
    );
    // A line that is cut is run again.
    std::fs::write(&path, &text[..text.len() - 20]).unwrap();
    assert_eq!(Results::load(&options.folder).unwrap().missing(), 1);
    assert_eq!(run_all(&toy, &study(GRID), &options).missing(), 0);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
}

#[test]
fn a_folder_is_worked_on_once_at_a_time() {
    let toy = Toy::new();
    let manifest = plan(&toy, &study(GRID)).manifest;
    let folder = toy.path("mine");
    let whole = Shard::WHOLE;
    let first = Store::open(&folder, &manifest, whole).unwrap();
    let options = options(&toy, "mine", 1);
    let ended = run(
        plan(&toy, &study(GRID)),
        &options,
        &Interrupts::default(),
        &mut |_| {},
    );
    let error = ended.unwrap_err();
    assert!(matches!(error, StudyError::Store(_)), "{error}");
    assert!(
        error
            .to_string()
            .contains("another process is working on these runs")
    );
    // Another part is nobody else's.
    Store::open(&folder, &manifest, Shard { index: 1, of: 2 }).unwrap();
    drop(first);
    run_all(&toy, &study(GRID), &options);
}
