//! The normal form says the same, and is its own normal form.

use proptest::prelude::*;

use super::{FIGURE_5, Options, read_model, shown};
use crate::language::findings::Notes;
use crate::language::format;
use crate::language::parser::parse;
use crate::language::tree::Tree;

fn check(text: &str, expected: &str) {
    let once = format(text).expect("it is well formed");
    assert_eq!(once, expected, "{text:?}");
    assert_eq!(format(&once).expect("it is well formed"), once);
}

fn tree(text: &str) -> Tree {
    let mut notes = Notes::default();
    let tree = parse(0, text.to_owned(), false, &mut notes);
    assert!(!notes.has_errors(), "{text:?}: {:?}", notes.finish());
    tree
}

#[test]
fn what_fits_stands_on_one_line() {
    check(
        "( Define_Type\n  Side( left,right ) )",
        "(Define_Type Side (left right))\n",
    );
    check("(a b)\n\n\n\n(c)(d)", "(a b)\n\n(c)\n(d)\n");
    check("(f(?a-->?b?c))", "(f (?a -> ?b ?c))\n");
    check("", "");
}

#[test]
fn comments_stay_where_they_are() {
    check("; a\n\n; b\n(c) ; d\n; e", "; a\n\n; b\n(c) ; d\n; e\n");
    check("(a ; b\n c)", "(a ; b\n c)\n");
    check("( ; a\n b\n ; c\n )", "( ; a\n b\n ; c\n)\n");
    check("(a (b ; c\n) d)", "(a\n (b ; c\n )\n d)\n");
    check("(a\n; own\n:k v)", "(a\n ; own\n :k v)\n");
}

#[test]
fn figure_5_gets_the_parenthesis_that_it_lacks() {
    let expected = "\
(Define_Compatibility
 (SINGLE ((Rover_Class TempMeasure_SV) ((TempReadCompare (-> ?state_fan ?temp True)))))
 :duration_bounds [*temp_freq* *temp_freq*]
 :parameter_functions (new_fan_state (*tempthreshold* ?temp ?state_fan))
 :compatibility_spec
 (AND (meets (SINGLE ((Rover_Class Fans_SV) ((DeviceSetFanState (?state_fan ->))))))))
";
    check(FIGURE_5, expected);
    let read = read_model(
        "figure-5.ddl",
        expected,
        &Options {
            strict: true,
            ..Options::default()
        },
    );
    assert_eq!(shown(&read), "");
}

#[test]
fn the_models_are_in_normal_form() {
    for name in ["executive", "rover", "rover-problem", "rover-too-much"] {
        let path = std::format!("{}/models/{name}.ddl", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(&path).expect("the model is there");
        let normal = format(&text).expect("it is well formed");
        if std::env::var_os("FARSIDE_RENEW").is_some() {
            std::fs::write(&path, &normal).expect("it is written");
            continue;
        }
        assert!(
            normal == text,
            "{path} is not in normal form: renew it with FARSIDE_RENEW=1"
        );
    }
}

#[test]
fn what_is_not_well_formed_has_none() {
    let findings = format("(a [b)").expect_err("a span is not closed");
    assert_eq!(findings.to_string(), "text:1:6: error: expected ], found )");
}

/// Texts of all pieces of the syntax, in any layout, whose lists are closed.
fn texts() -> impl Strategy<Value = String> {
    const PIECES: [&str; 20] = [
        "(",
        "(",
        "(",
        "[",
        ")",
        ")",
        "]",
        "name",
        "?v",
        ":key",
        "12",
        "-3.5",
        "\"a b\"",
        "->",
        "→",
        "; a comment\n",
        "\n",
        "\n\n",
        ",",
        "SINGLE",
    ];
    let long = "a_name_that_is_so_long_that_few_of_it_fit_on_a_line";
    let pieces = prop::collection::vec((0..PIECES.len() + 1, any::<bool>()), 0..120);
    pieces.prop_map(move |pieces| {
        let (mut text, mut open) = (String::new(), Vec::new());
        for (piece, blank) in pieces {
            let piece = PIECES.get(piece).copied().unwrap_or(long);
            match piece {
                "(" => open.push(")"),
                "[" => open.push("]"),
                ")" | "]" if open.last() == Some(&piece) => {
                    open.pop();
                }
                ")" | "]" => continue,
                _ => {}
            }
            // Words need a blank between them, the other pieces do not.
            let word = |letter: char| letter.is_alphanumeric() || letter == '_' || letter == '"';
            let joins =
                text.ends_with(word) && piece.starts_with(|at: char| at != '(' && at != ')');
            if blank || joins {
                text.push(' ');
            }
            text.push_str(piece);
        }
        while let Some(close) = open.pop() {
            text.push_str(close);
        }
        text
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3_000))]

    #[test]
    fn the_normal_form_says_the_same_and_is_its_own(text in texts()) {
        // A keyword within SINGLE closes it, and then the rest may not be well formed.
        if let Ok(once) = format(&text) {
            prop_assert!(tree(&once) == tree(&text), "{}\n---\n{}", text, once);
            prop_assert_eq!(&format(&once).expect("it is well formed"), &once);
        }
    }
}
