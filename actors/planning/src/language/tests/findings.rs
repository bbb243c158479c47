//! What is said of each mistake, as `findings.txt` has it: a text, then its findings.
//! `FARSIDE_RENEW=1` writes the findings anew.

use super::*;

/// What the models among the texts have besides.
const BASE: &str = "\
(Define_Object_Class Rover :state_variables ((State Position_SV) (Free Work_SV)))
(Define_Object Rover r1 r2)
(Define_Object_Class Lander :state_variables ((State Mast_SV)))
(Define_Type Place (lander rock_1 rock_2))
(Define_Type Percent [0 100])
(Define_Predicate At ((Place ?place)))
(Define_Predicate Work ((Place ?place) (Percent ?effort) -> (Boolean ?done)))
(Define_Predicate Up ())
(Define_Member_Values (Rover Position_SV) (At))
(Define_Member_Values (Rover Work_SV) (Work))
(Define_Member_Values (Lander Mast_SV) (Up) :default (Up ()))
(Define_Resource (Rover battery) :kind depletable :capacity 10)
(Define_Resource (Rover bus) :kind renewable :capacity 3)
(Define_Table far (Place Place Number) (lander rock_1 5))
";

fn include(path: &str) -> Result<String, String> {
    match path {
        "base.ddl" => Ok(BASE.to_owned()),
        "once.ddl" => Ok("(Include \"base.ddl\") (Include \"base.ddl\")".to_owned()),
        "a.ddl" => Ok("(Include \"b.ddl\")".to_owned()),
        "b.ddl" => Ok("(Include \"a.ddl\")".to_owned()),
        "wrong.ddl" => Ok("(Define_Type\n 5)".to_owned()),
        deep if deep.starts_with("deep") => Ok(format!("(Include \"{deep}x\")")),
        _ => Err("there is no such file".to_owned()),
    }
}

/// The findings of a text: `whole` as it is, `model` and `problem` with what [`BASE`] declares,
/// `include` with files.
fn read(kind: &str, text: &str) -> String {
    let options = Options::default();
    match kind {
        "whole" => shown(&read_model("m", text, &options)),
        "model" => shown(&read_model("m", &format!("{text}\n{BASE}"), &options)),
        "problem" => {
            let model = read_model("m", BASE, &options).ok().expect("it is right");
            shown(&read_problem("p", text, &model, &options))
        }
        "include" => {
            let options = Options {
                include: Some(&include),
                ..options
            };
            shown(&read_model("m.ddl", text, &options))
        }
        _ => panic!("{kind}: expected whole, model, problem or include"),
    }
}

#[test]
fn every_mistake_is_said_with_its_place_and_the_nearest_name() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/src/language/tests/findings.txt"
    );
    let text = std::fs::read_to_string(path).expect("the cases are there");
    let mut renewed = String::new();
    for case in text.split_terminator("====\n") {
        let (input, expected) = case.split_once("---\n").expect("a case has findings");
        let (kind, text) = input.split_once('\n').expect("a case has a kind");
        let found = read(kind, text);
        let found = if found.is_empty() {
            found
        } else {
            found + "\n"
        };
        if std::env::var_os("FARSIDE_RENEW").is_none() {
            assert_eq!(found, expected, "{text}");
        }
        renewed += &std::format!("{kind}\n{text}---\n{found}====\n");
    }
    if std::env::var_os("FARSIDE_RENEW").is_some() {
        std::fs::write(path, renewed).expect("they are written");
    }
}
