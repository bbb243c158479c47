//! Files that are read, and what is said of mistakes in them.

use super::*;

fn error(text: &str) -> String {
    let mut definitions = Definitions::builtin();
    let before = definitions.clone();
    let error = definitions.read("mine.toml", text).unwrap_err();
    assert_eq!(definitions, before, "nothing of a wrong file is taken");
    error.to_string()
}

#[test]
fn what_is_built_in_is_there() {
    let definitions = Definitions::builtin();
    for name in ["assign-and-release", "lease", "market"] {
        definitions.protocol(name).unwrap();
    }
    let observation = definitions.activity("observation").unwrap();
    assert_eq!(observation.protocol, "assign-and-release");
}

#[test]
fn mistakes_are_named_with_their_lines() {
    let unknown =
        error("[protocol.mine]\nchooser = \"planner\"\nreassign = \"never\"\nleese = \"2h\"\n");
    assert!(
        unknown.contains("line 4") && unknown.contains("leese"),
        "{unknown}"
    );
    let variant = error("[protocol.mine]\nchooser = \"dice\"\nreassign = \"never\"\n");
    assert!(
        variant.contains("line 2") && variant.contains("best-bid"),
        "{variant}"
    );
    let missing = error("\n[protocol.mine]\nchooser = \"planner\"\nreassign = \"lease\"\n");
    let expected = "mine.toml, line 2: protocol \"mine\": reassign = \"lease\" without a lease: expected a key `lease`";
    assert_eq!(missing, expected);
    let unit =
        error("[protocol.mine]\nchooser = \"planner\"\nreassign = \"lease\"\nlease = \"2\"\n");
    assert!(
        unit.contains("line 4") && unit.contains("duration"),
        "{unit}"
    );
    let protocol = error("[activity.digging]\nprotocol = \"leese\"\n");
    let expected =
        "mine.toml, line 1: activity \"digging\": no protocol \"leese\"; did you mean \"lease\"?";
    assert_eq!(protocol, expected);
    let role = error(
        "[activity.digging]\nprotocol = \"lease\"\n[activity.digging.parameters]\nweight = [{ role = \"king\", stages = [] }]\n",
    );
    assert!(role.contains("line 4") && role.contains("owner"), "{role}");
}

#[test]
fn keys_that_do_not_go_together_are_refused() {
    let with = |more: &str| error(&format!("[protocol.mine]\n{more}\n"));
    let cases = [
        ("chooser = \"best-bid\"\nreassign = \"never\"", "bids_for"),
        (
            "chooser = \"planner\"\nreassign = \"never\"\nbids_for = \"1min\"",
            "best-bid",
        ),
        (
            "chooser = \"best-bid\"\nreassign = \"never\"\nbids_for = \"0s\"",
            "over 0",
        ),
        (
            "chooser = \"planner\"\nreassign = \"never\"\nrenewed = true",
            "`lease`",
        ),
        (
            "chooser = \"planner\"\nreassign = \"lease\"\nlease = \"0s\"",
            "over 0",
        ),
        (
            "chooser = \"planner\"\nreassign = \"never\"\ngive_up_after = 0",
            "at least 1",
        ),
    ];
    for (text, expected) in cases {
        let said = with(text);
        assert!(said.contains(expected), "{text}: {said}");
    }
}
