//! Texts that nobody means well with: an error or a result, and never more than the text is worth.

use proptest::prelude::*;

use super::*;

fn both(text: &str) -> [Vec<Finding>; 2] {
    let options = Options::default();
    let model = read_model("m", text, &options);
    let problem = read_problem("p", text, &rover(), &options);
    for (findings, omitted) in [
        (&model.findings, model.omitted),
        (&problem.findings, problem.omitted),
    ] {
        assert!(findings.len() <= MOST_FINDINGS);
        assert!(omitted == 0 || findings.len() == MOST_FINDINGS);
    }
    // The normal form of a text may be longer than a text may be.
    if let Ok(once) = super::super::format(text)
        && once.len() <= 16 << 20
    {
        assert_eq!(
            super::super::format(&once).expect("it is well formed"),
            once
        );
    }
    [model.findings, problem.findings]
}

#[test]
fn lists_within_lists_are_an_error_however_deep() {
    for depth in [1_000, 1_000_000] {
        for (open, close) in [("(", ")"), ("[", "]"), ("(AND ", ")"), ("(SINGLE (", "))")] {
            let text = open.repeat(depth) + &close.repeat(depth);
            let [model, _] = both(&text);
            let deep = model
                .iter()
                .filter(|of| of.expected == "at most 100 lists in one another");
            assert_eq!(deep.count(), 1, "{open} {depth}");
            let [model, _] = both(&open.repeat(depth));
            assert!(model[0].severity == Severity::Error, "{open} {depth}");
        }
        let [model, _] = both(&")".repeat(depth));
        assert_eq!(model.len(), MOST_FINDINGS);
    }
}

#[test]
fn a_body_as_deep_as_allowed_is_read() {
    let (head, rest) = ROVER
        .split_once("(Define_Search_Control")
        .expect("it has one");
    let deep = "(OR (AND ".repeat(45);
    let rule = std::format!(
        "(Define_Compatibility (SINGLE ((Rover Arm_SV) ((WarmUp)))) :compatibility_spec {deep}\
         (starts (SINGLE ((Rover Observations_SV) ((TakeImage)))))"
    ) + &"))".repeat(45)
        + ")";
    let text = std::format!("{head}{rule}\n(Define_Search_Control{rest}");
    assert_eq!(shown(&read_model("m", &text, &Options::default())), "");
}

/// A text of about 10 MB: some head, and as many pieces as fit.
fn large(head: &str, piece: impl Fn(usize) -> String, tail: &str) -> String {
    let mut text = head.to_owned();
    for number in 0.. {
        text += &piece(number);
        if text.len() > 10_000_000 {
            break;
        }
    }
    text + tail
}

#[test]
fn ten_megabytes_are_read_or_refused() {
    let (head, _) = ROVER
        .split_once("(Define_Search_Control")
        .expect("it has one");
    let rule = "(Define_Compatibility (SINGLE ((Rover Arm_SV) ((WarmUp ())))) :duration_bounds \
                [5 9])\n";
    let read = read_model(
        "m",
        &large(head, |_| rule.to_owned(), ""),
        &Options::default(),
    );
    assert_eq!(shown(&read), "");
    let texts = [
        large("", |_| "()".to_owned(), ""),
        large("", |_| "( ".to_owned(), ""),
        large(
            "",
            |number| std::format!("(Define_Type T{number} (a{number}))"),
            "",
        ),
        large(
            "",
            |number| std::format!("(Define_Predicate P ((T{number} ?x)))\n"),
            "",
        ),
        large(
            "(Define_Type T (",
            |number| std::format!("a{number} "),
            "))",
        ),
        large("(Define_Type T (", |_| "a ".to_owned(), "))"),
        large(
            "(Define_Problem p :horizon [0 9]) ",
            |_| "(Goal x y) ".to_owned(),
            "",
        ),
        large(
            "(Define_Object_Class R :state_variables ((Free A_SV))) (Define_Predicate P ())
            (Define_Member_Values (R A_SV) (P))
            (Define_Compatibility (SINGLE ((R A_SV) ((P)))) :duration_bounds [1 2])
            (Define_Object R ",
            |number| std::format!("r{number} "),
            ")",
        ),
        large("\"", |_| "a".to_owned(), ""),
        large("", |_| "a".to_owned(), ""),
        large("", |_| "; a\n".to_owned(), ""),
        large("(a ", |_| ":k ".to_owned(), ")"),
    ];
    for text in texts {
        let read = read_model("m", &text, &Options::default());
        assert!(read.findings.len() <= MOST_FINDINGS);
        if let Some(last) = read.findings.last() {
            assert!(last.to_string().len() < 1_000, "{last}");
        }
        let _ = super::super::format(&text);
    }
    let too_long = "a".repeat(17 << 20);
    let read = read_model("m", &too_long, &Options::default());
    assert_eq!(
        shown(&read),
        "m:1:1: error: expected at most 16777216 bytes in all files, found 17825792 or more"
    );
}

#[test]
fn what_is_multiplied_by_its_objects_has_a_limit() {
    let mut text = "(Define_Object_Class R :state_variables ((Free A_SV)))
        (Define_Predicate P ()) (Define_Member_Values (R A_SV) (P))
        (Define_Object R "
        .to_owned();
    for number in 0..10_000 {
        text += &std::format!("r{number} ");
    }
    text += ")\n";
    for _ in 0..2_000 {
        text += "(Define_Compatibility (SINGLE ((R A_SV) ((P)))) :compatibility_spec
            (starts (SINGLE ((?other A_SV) ((P))))))\n";
    }
    let read = read_model("m", &text, &Options::default());
    let found = shown(&read);
    assert_eq!(
        found,
        "m:4:1: error: expected at most 2097152 names, each counted once an object, found more"
    );
}

#[test]
fn every_prefix_of_a_model_is_an_error_or_a_model() {
    for (at, _) in ROVER.char_indices().filter(|(at, _)| at % 13 == 0) {
        both(&ROVER[..at]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn bytes_of_any_kind_are_an_error_or_a_result(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        both(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn edits_of_a_model_are_an_error_or_a_result(
        edits in prop::collection::vec((0..ROVER.len(), 0..12_usize, 0..ROVER.len(), 0..40_usize), 1..6),
    ) {
        let mut bytes = [ROVER.as_bytes(), ROVER_PROBLEM.as_bytes()].concat();
        for (at, gone, from, many) in edits {
            let put = bytes[from..(from + many).min(bytes.len())].to_vec();
            let at = at.min(bytes.len());
            let end = (at + gone).min(bytes.len());
            bytes.splice(at..end, put);
        }
        both(&String::from_utf8_lossy(&bytes));
    }
}
