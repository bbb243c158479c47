//! What cannot be is said, by key and name.

use super::runs::Run;

fn check(text: &str, expected: &str) {
    let run = Run {
        text,
        ..Run::default()
    };
    let said = run.tried().err().unwrap_or_else(|| "nothing".to_owned());
    assert!(said.contains(expected), "{text}: {said}");
}

#[test]
fn goals_that_cannot_be_are_named() {
    check(
        "goal = [{ name = 'far', east_m = 41.0 }]",
        "goal.0.east_m: 41 m of goal \"far\": outside the terrain, expected within 40 m",
    );
    check(
        "goal = [{ name = 'a', rock = 90 }]",
        "goal.0.rock: 90 of goal \"a\": the field has 90 rocks",
    );
    check(
        "goal = [{ name = 'a', weight = nan }]",
        "goal.0.weight: NaN: expected",
    );
    check(
        "goal = [{ name = 'a', change = [{ at = '1h', weight = inf }] }]",
        "goal.0.change.0.weight: inf: expected",
    );
    check("goal = [{ weight = 1.0 }]", "goal.0.name: missing");
    check(
        "goal = [{ name = 'a' }, { name = 'a', east_m = 1.0 }]",
        "goal.1.name: \"a\": expected each name once",
    );
    check(
        "goal = [{ name = 'a', opens = '3h', closes = '2h' }]",
        "goal.0.closes: 7200s: the window never opens",
    );
    check(
        "goal = [{ name = 'a', opens = '3h', closes = '3h1min' }]",
        "goal.0.closes: 10860s: the observation takes",
    );
    check(
        "goal = [{ name = 'a', observation = 'smell' }]",
        "unknown variant `smell`",
    );
    check(
        "goal = [{ name = 'a', added = '2h', withdrawn = '1h' }]",
        "goal.0.withdrawn: 3600s: expected after 7200s",
    );
}

#[test]
fn combinations_and_requirements_that_cannot_be_are_named() {
    let goals = "goal = [{ name = 'peak', rock = 1 }, { name = 'foot', rock = 2 }]\n";
    check(
        &format!("{goals}combination = [{{ goals = ['peak', 'food'] }}]"),
        "combination.0.goals: no goal \"food\"; did you mean \"foot\"?",
    );
    check(
        &format!("{goals}combination = [{{ goals = ['peak', 'peak'] }}]"),
        "combination.0.goals: [\"peak\", \"peak\"]: expected two different goals",
    );
    check(
        &format!("{goals}combination = [{{ goals = ['peak', 'foot'], weight = nan }}]"),
        "combination.0.weight: NaN",
    );
    check(
        "goal = [{ name = 'a', rock = 1, requires = ['b'] }, { name = 'b', rock = 2, requires = ['a'] }]",
        "goal.0.requires: goals that require each other in a circle: a, b",
    );
    check(
        "goal = [{ name = 'a', rock = 1, requires = ['c'] }]",
        "goal.0.requires: no goal \"c\"",
    );
}

#[test]
fn mandatory_goals_that_do_not_fit_are_explained() {
    let goal = |name: &str, rock: u32| {
        format!("{{ name = '{name}', rock = {rock}, mandatory = true, closes = '30min' }}")
    };
    let goals: Vec<String> = (0..5).map(|rock| goal(&format!("g{rock}"), rock)).collect();
    check(
        &format!("goal = [{}]", goals.join(", ")),
        "mandatory goals cannot all be met: g0, g1, g2, g3, g4 take 6600s between 0s and 1800s, where 3 \
         rovers have 5400s of light",
    );
}

#[test]
fn mandatory_goals_for_which_there_is_too_little_of_anything_are_explained() {
    check(
        "goal = [{ name = 'far', east_m = 39.0, mandatory = true, closes = '30min' }]",
        "goal.0.mandatory: mandatory goal \"far\" cannot be met for want of time: the drive takes",
    );
    check(
        "rover = { array_efficiency = 0, charge = 0.45 }\n\
         goal = [{ name = 'a', rock = 1 }, { name = 'b', rock = 2, mandatory = true, closes = '8h' }]",
        "goal.1.mandatory: mandatory goals cannot all be met: b take 26400 J beyond what rovers' bodies take between \
         0s and 28800s, where 3 rovers have 0 J above their reserve",
    );
    check(
        "rover.memory = '20kB'\nexecution.communication = '0s'\n\
         goal = [{ name = 'b', rock = 2, mandatory = true, closes = '8h' }]",
        "goal.0.mandatory: mandatory goals cannot all be met: b store 2000000 bit between 0s and 28800s, where 3 \
         rovers can store and send home 480000 bit",
    );
    // One without a window has the whole run.
    check(
        "until = '25min'\ngoal = [{ name = 'far', east_m = 39.0, mandatory = true }]",
        "goal.0.mandatory: mandatory goal \"far\" cannot be met for want of time",
    );
}

#[test]
fn goals_for_two_rovers_that_cannot_be_are_named() {
    let goal = |more: &str| {
        format!(
            "goal = [{{ name = 'a', rock = 1 }}, {{ name = 'meet', east_m = 1.0, rovers = 2{more} }}]"
        )
    };
    check(
        &format!("team.rovers = 1\n{}", goal("")),
        "goal.1.rovers: goal \"meet\" needs 2 rovers, and there is 1",
    );
    check(
        &goal(", mandatory = true"),
        "goal.1.mandatory: goal \"meet\" needs 2 rovers, and neither",
    );
    check(
        &goal(", requires = ['a']"),
        "goal.1.requires: goal \"meet\" needs 2 rovers",
    );
    check(
        &format!("survey.protocol = 'market'\n{}", goal("")),
        "goal.1.rovers: goal \"meet\" needs 2 rovers, whom the centre's planner appoints",
    );
    check(
        "goal = [{ name = 'a', rock = 1, rovers = 3 }]",
        "goal.0.rovers: 3: expected 1 to 2",
    );
}

#[test]
fn a_planner_of_the_whole_team_and_an_objective_that_is_none_are_refused() {
    check(
        "planner.choice = 'lns'",
        "planner.choice: \"lns\" plans for all rovers at once with all batteries and memories known",
    );
    check("objective.drive_per_m = nan", "objective.drive_per_m: NaN");
    check("objective.drive = 1.0", "unknown field `drive`");
}

#[test]
fn a_centre_windows_and_protocols_that_cannot_be_are_named() {
    check(
        "survey.central = 'rover_04'",
        "survey.central: \"rover_04\" is no host: expected \"lander\" or a rover; did you mean \"rover_0",
    );
    check(
        "survey.contact = 0",
        "survey.contact: 0: the windows never open",
    );
    check(
        "survey.protocol = 'markt'",
        "survey.protocol: no protocol \"markt\"; did you mean \"market\"?",
    );
    check(
        "survey = { protocol = 'assign-and-release', reassign = 'lease' }",
        "survey.reassign: \"lease\": protocol \"assign-and-release\" has no lease",
    );
    check(
        "survey.lease = '1h'",
        "survey.lease: 3600s: expected over 7210s, an observation takes 7200s",
    );
    check(
        "survey.election = '1s'",
        "survey.election: election = 1s: expected over 20s",
    );
    check("survey.loop_every = '0s'", "survey.loop_every: 0s");
    check(
        "survey.protocol_file = 'none.toml'",
        "survey.protocol_file: ./none.toml: cannot read it",
    );
    check("team.rover = 3", "unknown field `rover`");
}
