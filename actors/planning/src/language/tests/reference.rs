//! The reference page in `docs/`: every example of it is read here.
//!
//! Blocks of `ddl,model` are one model together, those of `ddl,problem` a problem of it. A block
//! `ddl,alone` is a text of its own, and `ddl,wrong` one with the findings that the next block of
//! `text` has. All but the wrong ones are in normal form.

use super::*;

const PAGE: &str = include_str!("../../../../../docs/src/reference/planning.md");

/// The kind of each fenced block and its text.
fn blocks() -> Vec<(&'static str, &'static str)> {
    let mut blocks = Vec::new();
    let mut rest = PAGE;
    while let Some((_, after)) = rest.split_once("\n```") {
        let (kind, after) = after.split_once('\n').expect("a block has a first line");
        let (text, after) = after.split_once("```\n").expect("a block is closed");
        blocks.push((kind, text));
        rest = after;
    }
    blocks
}

fn all(kind: &str) -> String {
    let texts = blocks()
        .into_iter()
        .filter(|(of, _)| *of == kind)
        .map(|(_, text)| text);
    texts.collect::<Vec<_>>().join("\n")
}

#[test]
fn the_examples_of_the_reference_are_right() {
    let options = Options {
        strict: true,
        ..Options::default()
    };
    let read = read_model("example.ddl", &all("ddl,model"), &options);
    assert_eq!(shown(&read), "");
    let model = read.value.expect("it is right");
    let read = read_problem("problem.ddl", &all("ddl,problem"), &model, &options);
    assert_eq!(shown(&read), "");
    let mut blocks = blocks().into_iter();
    while let Some((kind, text)) = blocks.next() {
        if kind != "ddl,wrong" {
            assert_eq!(super::super::format(text).expect("it is well formed"), text);
        }
        match kind {
            "ddl,model" | "ddl,problem" => {}
            "ddl,alone" => assert_eq!(shown(&read_model("alone.ddl", text, &options)), ""),
            "ddl,wrong" => {
                let (kind, findings) = blocks.next().expect("its findings follow");
                assert_eq!(kind, "text");
                let read = read_model("example.ddl", text, &options);
                assert_eq!(shown(&read) + "\n", findings);
            }
            _ => panic!("{kind}: nobody reads such a block"),
        }
    }
}

#[test]
fn the_reference_names_every_form_and_relation() {
    let known = Functions::default();
    let mut words: Vec<&str> = super::super::analyse::words().collect();
    words.extend(known.names());
    let missing: Vec<&str> = words
        .into_iter()
        .filter(|word| !PAGE.contains(word))
        .collect();
    assert_eq!(missing, [""; 0]);
}
