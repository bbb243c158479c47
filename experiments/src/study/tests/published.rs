//! Published figures and variants, from the study's text to its cells.

use proptest::prelude::*;

use super::super::Study;
use super::super::results::{Claim, Manifest, Results};
use super::refused::{check, refused};
use super::toy::{self, Toy, plan, registry, study};
use super::{GRID, options, run_all};
use crate::registry::Registry;

/// A study of three levels and two delays with a published table of these figures.
fn table(more: &str, values: &str) -> String {
    let head = "[[published]]\nmetric = 'value'\ntitle = 'T'\nsource = 'S'\n";
    study(&format!("{GRID}{head}{more}\nvalues = [{values}]\n"))
}

fn manifest(text: &str) -> Manifest {
    plan(&Toy::new(), text).manifest
}

#[test]
fn figures_find_their_cells() {
    let values = "{ level = 1, delay = '1000us', value = 3 }, { level = 2.0, below = 7.5 }, \
                  { linear = 'level', delay = '2s' }";
    let manifest = manifest(&table("unit = '%'\nscale = 100\nwhy = 'Y'", values));
    let published = &manifest.published[0];
    let cells: Vec<&[usize]> = published
        .figures
        .iter()
        .map(|f| f.cells.as_slice())
        .collect();
    assert_eq!(cells, [&[0][..], &[2, 3], &[1, 3, 5]]);
    let claims: Vec<&Claim> = published.figures.iter().map(|f| &f.claim).collect();
    let linear = Claim::Linear("level".to_owned());
    assert_eq!(claims, [&Claim::Value(3.0), &Claim::Below(7.5), &linear]);
    assert_eq!((published.scale, published.why.as_str()), (100.0, "Y"));
    let json = serde_json::to_string(&manifest).unwrap();
    assert_eq!(serde_json::from_str::<Manifest>(&json).unwrap(), manifest);
    // What knows no published figures is written as it always was.
    let without = self::manifest(&study(GRID));
    assert!(
        !serde_json::to_string(&without)
            .unwrap()
            .contains("published")
    );
}

#[test]
fn a_mistake_in_a_figure_is_said_where_it_stands() {
    let said = |more: &str, values: &str| refused(&table(more, values));
    for (values, starts, holds) in [
        (
            "{ lvel = 1, value = 3 }",
            "x.toml:18:20: published.0.values.0.lvel",
            "did you mean \"level\"?",
        ),
        (
            "{ level = 1, vlaue = 3 }",
            "x.toml:18:32: ",
            "did you mean \"value\"?",
        ),
        (
            "{ level = 9, value = 3 }",
            "x.toml:18:21: ",
            "did you mean 3?\n  expected one of 1, 2, 3",
        ),
        (
            "{ level = 'x', value = 3 }",
            "x.toml:18:21: ",
            "expected one of 1, 2, 3",
        ),
        (
            "{ delay = '3s', value = 3 }",
            "x.toml:18:21: ",
            "no cell has 3s; did you mean 2s?",
        ),
        (
            "{ level = 1 }",
            "x.toml:18:11: published.0.values.0: ",
            "0 claims: expected one of",
        ),
        ("{ value = 1, about = 2 }", "x.toml:18:11: ", "2 claims"),
        ("{ value = 'many' }", "x.toml:18:21: ", "expected a number"),
        ("{ value = nan }", "x.toml:18:21: ", "expected a number"),
        (
            "{ value = 1, quote = 3 }",
            "x.toml:18:32: ",
            "the publication's words",
        ),
        (
            "{ linear = 'levels' }",
            "x.toml:18:22: ",
            "did you mean \"level\"?",
        ),
        (
            "{ linear = 'delay' }",
            "x.toml:18:11: ",
            "delay has 2 values here: a line needs three",
        ),
        (
            "{ level = 1, value = 3 }, { delay = '1ms', value = 4 }",
            "x.toml:18:37: ",
            "for cell 0 (1, 1ms) too",
        ),
        (
            "",
            "x.toml:18:10: published.0.values",
            "at least one figure",
        ),
    ] {
        let message = said("", values);
        assert!(message.starts_with(starts), "{values}: {message}");
        assert!(
            message.contains(holds),
            "{values}: {holds:?} is not in {message}"
        );
    }
    let one = "{ value = 1 }";
    for (more, holds) in [
        (
            "scale = 0",
            "published.0.scale: 0: expected a number above zero",
        ),
        (
            "rows = 'levle'",
            "published.0.rows: unknown value \"levle\"; did you mean \"level\"?",
        ),
        ("whi = 'x'", "did you mean \"why\"?"),
    ] {
        let message = said(more, one);
        assert!(message.contains(holds), "{message}");
    }
    let metric = table("", one).replace("metric = 'value'", "metric = 'vlaue'");
    let message = refused(&metric);
    assert!(
        message.starts_with("x.toml:14:10: published.0.metric: "),
        "{message}"
    );
    assert!(message.contains("did you mean \"value\"?"), "{message}");
    let untitled = table("", one).replace("title = 'T'", "title = ' '");
    assert!(refused(&untitled).contains("published.0.title: expected some words"));
    let words = "[[factor]]\nname = 'where'\nkey = 'toy.fails'\nvalues = ['a', 'b', 'c']\n\
        [[published]]\nmetric = 'value'\ntitle = 'T'\nsource = 'S'\nvalues = ";
    check(
        &format!("{words}[{{ linear = 'where' }}]"),
        "x.toml:12:",
        "whose values are numbers",
    );
    check(
        &format!("{words}[{{ where = 'd', value = 1 }}]"),
        "x.toml:12:",
        "expected one of a, b, c",
    );
    let pairs = GRID.replace("[1, 2, 3]", "[1, 2]");
    let apart = table("", "{ level = 1, delay = '2s', value = 1 }").replace(GRID, &pairs);
    let message = refused(&apart.replacen("seeds = 6", "design = 'paired'", 1));
    assert!(
        message.contains("no cell has all these values"),
        "{message}"
    );
}

#[test]
fn other_published_figures_keep_the_runs() {
    let toy = Toy::new();
    let options = options(&toy, "out", 2);
    let before = run_all(&toy, &study(GRID), &options);
    let lines = std::fs::read_to_string(options.folder.join("runs.jsonl")).unwrap();
    let after = run_all(&toy, &table("", "{ value = 3 }"), &options);
    assert_eq!(
        (after.runs, after.manifest.published.len()),
        (before.runs, 1)
    );
    assert_eq!(
        std::fs::read_to_string(options.folder.join("runs.jsonl")).unwrap(),
        lines
    );
    // More seeds and other figures at once.
    let more = table("", "{ value = 4 }");
    let more = toy::plan_with(&toy, &more, Some(7)).unwrap();
    let interrupts = super::Interrupts::default();
    super::run(more, &options, &interrupts, &mut |_| {}).unwrap();
    let grown = Results::load(&options.folder).unwrap();
    assert_eq!((grown.runs.len(), grown.missing()), (42, 0));
    assert_eq!(
        grown.manifest.published[0].figures[0].claim,
        Claim::Value(4.0)
    );
    let mut unlike = grown.clone();
    unlike.manifest.published.clear();
    let error = Results::merge([grown, unlike]).unwrap_err().to_string();
    assert!(error.contains("the published figures"), "{error}");
}

const VARIANTS: &str = "[[factor]]\nname = 'how'\nvariants = [\n\
    { name = 'plain' },\n\
    { name = 'slow', set = { toy.delay = '3s', toy.level = 2 } },\n\
    { name = 'high', set = { 'toy.level' = 9 } },\n]\n";

#[test]
fn variants_set_what_they_say() {
    let two =
        format!("{VARIANTS}[[factor]]\nname = 'f'\nkey = 'toy.fail_level'\nvalues = [0, 5]\n");
    let manifest = manifest(&study(&two));
    let sets: Vec<String> = manifest
        .cells
        .iter()
        .map(|cell| cell.sets.join(" "))
        .collect();
    assert_eq!(
        sets,
        [
            "toy.fail_level=0",
            "toy.fail_level=5",
            "toy.delay=3s toy.level=2 toy.fail_level=0",
            "toy.delay=3s toy.level=2 toy.fail_level=5",
            "toy.level=9 toy.fail_level=0",
            "toy.level=9 toy.fail_level=5",
        ]
    );
    assert_eq!(manifest.cells[2].texts, ["slow", "0"]);
    // Names that are quantities are numbers, and go along axes.
    let times = VARIANTS
        .replace("plain", "1s")
        .replace("slow", "2s")
        .replace("high", "500ms");
    let manifest = self::manifest(&study(&times));
    let values: Vec<f64> = manifest
        .cells
        .iter()
        .map(|c| c.values[0].as_f64().unwrap())
        .collect();
    assert_eq!(
        (values, manifest.factors[0].unit.as_str()),
        (vec![1.0, 2.0, 0.5], "s")
    );
    let mixed = self::manifest(&study(&VARIANTS.replace("plain", "1s")));
    assert!(mixed.cells.iter().all(|cell| cell.values[0].is_string()));
    // In a list the cells name them.
    let list =
        format!("design = 'list'\n{VARIANTS}[[cell]]\nhow = 'high'\n[[cell]]\nhow = 'plain'\n");
    let manifest = self::manifest(&study(&list));
    assert_eq!(manifest.cells[0].sets, ["toy.level=9"]);
    assert!(manifest.cells[1].sets.is_empty());
    check(
        &list.replace("'high'\n[[", "'hihg'\n[["),
        "x.toml:13:7: cell.0.how",
        "did you mean \"high\"?",
    );
}

#[test]
fn variants_change_the_runs_that_they_say() {
    let toy = Toy::new();
    let results = run_all(
        &toy,
        &study(&format!("seeds = 2\n{VARIANTS}")),
        &options(&toy, "out", 1),
    );
    let value = |cell: usize| {
        let super::RunOutcome::Done {
            metrics,
            sim_time_s,
            ..
        } = &results.of_cell(cell)[0].outcome
        else {
            panic!("failed")
        };
        (metrics["value"].as_f64().unwrap(), *sim_time_s)
    };
    // The toy's value is its level times 4 with seed 1.
    assert_eq!(
        [value(0), value(1), value(2)],
        [(4.0, 1.0), (8.0, 3.0), (36.0, 1.0)]
    );
}

#[test]
fn a_mistake_in_a_variant_is_said_where_it_stands() {
    let with = |from: &str, to: &str| VARIANTS.replace(from, to);
    for (text, starts, holds) in [
        (
            with("'slow'", "'plain'"),
            "x.toml:6:12: factor.0.variants",
            "plain is there twice",
        ),
        (
            with("'slow'", "'a,b'"),
            "x.toml:8:10: factor.0.variants.1.name",
            "without commas",
        ),
        (
            with("'toy.level' = 9", "'toy..level' = 9"),
            "x.toml:9:41: ",
            "no key of a scenario",
        ),
        (
            with("'toy.level' = 9", "seed = 9"),
            "x.toml:9:33: ",
            "by its own key, seeds",
        ),
        (
            with("'toy.level' = 9", ""),
            "x.toml:9:1: factor.0.variants.2",
            "high sets the same as plain",
        ),
        (
            with("'toy.level' = 9", "'toy.levle' = 9"),
            "x.toml:9:40: factor how = high: ",
            "did you mean \"level\"?",
        ),
        (
            with("toy.level = 2", "toy.level = -2"),
            "x.toml:8:56: factor how = slow: ",
            "no less than 0",
        ),
        (
            with("name = 'plain'", "nmae = 'plain'"),
            "x.toml:7:3: ",
            "did you mean \"name\"?",
        ),
        (
            with("name = 'how'\n", "name = 'how'\nkey = 'toy.level'\n"),
            "x.toml:6:7: factor.0.key",
            "either these or variants",
        ),
    ] {
        let message = refused(&study(&text));
        assert!(message.contains(holds), "{holds:?} is not in {message}");
        assert!(
            message.starts_with(starts),
            "{starts:?} does not start {message}"
        );
    }
    let both = format!("{VARIANTS}[[factor]]\nname = 'l'\nkey = 'toy.level'\nvalues = [1]\n");
    check(
        &both,
        "x.toml:13:7: factor.1.key",
        "toy.level: another factor sets this key",
    );
    let after = format!("[[factor]]\nname = 'l'\nkey = 'toy.level'\nvalues = [1]\n{VARIANTS}");
    check(
        &after,
        "x.toml:10:12: factor.1.variants",
        "toy.level: another factor sets this key",
    );
    let toy = Toy::new();
    let folder = toy.path("x");
    let plan = Study::parse(
        "x.toml",
        study(VARIANTS),
        folder.parent().unwrap().to_owned(),
    );
    let plan = plan
        .unwrap()
        .plan(&["toy.delay=1s".to_owned()], None, &registry());
    let message = plan.err().unwrap().to_string();
    assert!(message.contains("as its factor how"), "{message}");
}

#[test]
fn built_in_studies_are_whole() {
    let registry = Registry::builtin();
    for name in registry.study_names() {
        let study = Study::open(name, &registry).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(study.question().ends_with('?'), "{name}");
        // With its own seeds: those of a study with blocks are whole blocks.
        let plan = study.plan(&[], None, &Registry::builtin());
        let manifest = plan
            .unwrap_or_else(|error| panic!("{name}: {error}"))
            .manifest;
        for table in &manifest.published {
            assert!(
                !table.source.is_empty() && !table.figures.is_empty(),
                "{name}"
            );
            assert!(
                table.figures.iter().all(|figure| !figure.cells.is_empty()),
                "{name}"
            );
        }
        // Lines are short enough for a terminal; figures of others may be long.
        let text = registry.study(name).unwrap();
        assert!(text.lines().all(|line| line.len() <= 140), "{name}");
    }
}

/// The paper's tables as they are printed there, row by row.
#[test]
fn built_in_tables_are_those_of_the_paper() {
    let printed = |study: &str, title: &str| -> Vec<f64> {
        let registry = Registry::builtin();
        let study = Study::open(study, &registry).unwrap();
        let manifest = study.plan(&[], Some(1), &registry);
        let manifest = manifest.unwrap().manifest;
        let table = manifest
            .published
            .iter()
            .find(|table| table.title.starts_with(title));
        let mut figures: Vec<(usize, f64)> = Vec::new();
        for figure in &table.unwrap().figures {
            let (&[cell], Claim::Value(value)) = (figure.cells.as_slice(), &figure.claim) else {
                panic!("{figure:?}")
            };
            figures.push((cell, *value));
        }
        figures.sort_by_key(|(cell, _)| *cell);
        assert!(
            figures
                .iter()
                .map(|(cell, _)| *cell)
                .eq(0..manifest.cells.len())
        );
        figures.into_iter().map(|(_, value)| value).collect()
    };
    let table_1 = [0., 0., 0., 0., 0., 0., 100., 2., 0., 100., 100., 58.];
    assert_eq!(printed("network/table-1", "Table 1"), table_1);
    let interventions = [21.16, 20.4, 19.5, 18.2];
    assert_eq!(
        printed("network/table-2", "Table 2: collision"),
        interventions
    );
    assert_eq!(
        printed("network/table-2", "Table 2: path"),
        [2.4, 1.9, 2.28, 1.88]
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// A figure is for exactly those cells that have all values it names, in whatever order.
    #[test]
    fn partial_figures_are_for_all_cells_that_fit(
        levels in proptest::sample::subsequence(vec![0u32, 1, 2, 3, 5, 8], 1..=5),
        delays in proptest::sample::subsequence(vec![1u32, 4, 9, 300], 1..=4),
        fails in proptest::sample::subsequence(vec!["a", "b", "c"], 1..=3),
        picks in [proptest::option::of(0usize..100), proptest::option::of(0usize..100), proptest::option::of(0usize..100)],
    ) {
        let delays: Vec<String> = delays.iter().map(|ms| format!("{ms}ms")).collect();
        let texts: [Vec<String>; 3] = [
            levels.iter().map(u32::to_string).collect(),
            delays.iter().map(|d| format!("'{d}'")).collect(),
            fails.iter().map(|f| format!("'{f}'")).collect(),
        ];
        let names = ["level", "delay", "fails"];
        let mut factors = String::new();
        let mut entry = String::new();
        for (at, name) in names.iter().enumerate() {
            let values = texts[at].join(", ");
            factors += &format!("[[factor]]\nname = '{name}'\nkey = 'toy.{name}'\nvalues = [{values}]\n");
            if let Some(pick) = picks[at] {
                entry += &format!("{name} = {}, ", texts[at][pick % texts[at].len()]);
            }
        }
        let text = study(&format!(
            "{factors}[[published]]\nmetric = 'value'\ntitle = 'T'\nsource = 'S'\n\
             values = [{{ {entry}value = 1 }}]\n"
        ));
        let manifest = manifest(&text);
        let mut expected = Vec::new();
        let mut cell = 0;
        for level in 0..levels.len() {
            for delay in 0..delays.len() {
                for fail in 0..fails.len() {
                    let fits = |((at, pick), texts): ((&usize, &Option<usize>), &Vec<String>)| {
                        pick.is_none_or(|pick| pick % texts.len() == *at)
                    };
                    if [level, delay, fail].iter().zip(&picks).zip(&texts).all(fits) {
                        expected.push(cell);
                    }
                    cell += 1;
                }
            }
        }
        prop_assert_eq!(&manifest.published[0].figures[0].cells, &expected);
    }
}
