//! What the tables of a model and a problem say of their texts.

use super::*;

const BASE: &str = "\
(Define_Object_Class Rover :state_variables ((State Position_SV) (Free Work_SV)))
(Define_Object Rover r1 r2)
(Define_Object_Class Lander :state_variables ((State Mast_SV)))
(Define_Type Place (base rock))
(Define_Predicate At ((Place ?place)))
(Define_Predicate Work ((Place ?place) (Rover ?with) -> (Boolean ?done)))
(Define_Predicate Up ())
(Define_Member_Values (Rover Position_SV) (At))
(Define_Member_Values (Rover Work_SV) (Work))
(Define_Member_Values (Lander Mast_SV) (Up) :default (Up ()))
(Define_Resource (Rover battery) :kind depletable :capacity 10)
(Define_Resource (Rover bus) :kind unary)
(Define_Resource (Lander store) :kind rate_limited :capacity 3 :window 9 :changes ((5 1) (2 -1)))
";

/// A model with some forms besides the usual ones.
fn model(forms: &str) -> Model {
    let text = std::format!("{BASE}{forms}");
    read_model("m", &text, &Options::default())
        .ok()
        .unwrap_or_else(|findings| panic!("{findings}"))
}

fn problem(forms: &str) -> Problem {
    let text = std::format!("(Define_Problem p :horizon [0 100])\n{forms}");
    let read = read_problem("p", &text, &model(""), &Options::default());
    read.ok().unwrap_or_else(|findings| panic!("{findings}"))
}

/// The names of the timelines of a pattern.
fn timelines<'m>(model: &'m Model, pattern: &Pattern) -> Vec<&'m str> {
    pattern
        .timelines
        .iter()
        .map(|&at| &*model.timelines[at].name)
        .collect()
}

fn relation(body: &Body) -> &Relation {
    match body {
        Body::Relation(relation) => relation,
        _ => panic!("{body:?}"),
    }
}

fn target(relation: &Relation) -> &Pattern {
    match &relation.target {
        Target::New(pattern, _) => pattern,
        Target::Label(_) => panic!("{relation:?}"),
    }
}

#[test]
fn objects_have_timelines_and_resources_by_their_names() {
    let model = model("");
    let names: Vec<&str> = model.timelines.iter().map(|of| &*of.name).collect();
    assert_eq!(
        names,
        [
            "r1.Position_SV",
            "r1.Work_SV",
            "r2.Position_SV",
            "r2.Work_SV",
            "Mast_SV"
        ]
    );
    let names: Vec<&str> = model.resources.iter().map(|of| &*of.name).collect();
    assert_eq!(
        names,
        ["r1.battery", "r2.battery", "r1.bus", "r2.bus", "store"]
    );
    assert_eq!(model.resources[2].limits, Span::new(0, 1));
    assert_eq!(model.resources[4].changes, [(2, -1), (5, 1)]);
    assert_eq!(
        model.resources[4].kind,
        ResourceKind::RateLimited { window_ticks: 9 }
    );
    let filler = model.timelines[4]
        .default
        .as_ref()
        .expect("it has a default");
    assert_eq!(model.predicates[filler.predicate].name, "Up");
    assert_eq!(model.types[TRUTH].values, Values::Truth);
    assert_eq!(model.types[NUMBER].values, Values::Numbers(Span::ALL));
}

#[test]
fn the_masters_class_is_the_same_object_and_another_class_any() {
    let model = model(
        "(Define_Compatibility (SINGLE ((Rover Work_SV) ((Work (?p ?w -> ?d)))))
          :uses ((battery) 1) ((bus) 1)
          :consumes ((Lander store) 1)
          :compatibility_spec (AND
           (contained_by (SINGLE ((Rover Position_SV) ((At (?p))))))
           (contained_by (SINGLE ((Lander Mast_SV) ((Up ())))))
           (before (SINGLE ((r1 Position_SV) ((At (base))))))
           (before (SINGLE ((?w Position_SV) ((At (base))))))))",
    );
    assert_eq!(model.rules.len(), 2);
    for (rule, own) in model.rules.iter().zip(["r1", "r2"]) {
        let with = |name: &str| std::format!("{own}.{name}");
        assert_eq!(timelines(&model, &rule.master), [with("Work_SV")]);
        let Body::All(parts) = &rule.body else {
            panic!("{:?}", rule.body)
        };
        let of = |part: usize| timelines(&model, target(relation(&parts[part])));
        assert_eq!(of(0), [with("Position_SV")]);
        assert_eq!(of(1), ["Mast_SV"]);
        assert_eq!(of(2), ["r1.Position_SV"]);
        assert_eq!(of(3), ["r1.Position_SV", "r2.Position_SV"]);
        let object = target(relation(&parts[3]))
            .object
            .expect("it is a variable");
        assert_eq!(rule.variables[object].name, "?w");
        let resources: Vec<&str> = rule
            .effects
            .iter()
            .map(|of| &*model.resources[of.resources[0]].name)
            .collect();
        assert_eq!(
            resources,
            [with("battery"), with("bus"), "store".to_owned()]
        );
        assert_eq!(rule.labels, 5);
    }
    for (timeline, rules) in model.rules_by_timeline.iter().enumerate() {
        let expected: &[RuleId] = match timeline {
            1 => &[0],
            3 => &[1],
            _ => &[],
        };
        assert_eq!(rules[0], expected);
    }
}

#[test]
fn the_variable_of_a_master_is_its_object() {
    let model = model(
        "(Define_Compatibility (SINGLE ((?r Work_SV) ((Work (?p ?r -> ?d)))))
          :compatibility_spec (contained_by (SINGLE ((?r Position_SV) ((At (?p)))))))",
    );
    let rule = &model.rules[1];
    assert_eq!(timelines(&model, &rule.master), ["r2.Work_SV"]);
    assert_eq!(rule.master.object, Some(0));
    assert_eq!(
        timelines(&model, target(relation(&rule.body))),
        ["r2.Position_SV"]
    );
    // A master of one object holds for it alone.
    let one = "(Define_Compatibility (SINGLE ((r2 Work_SV) ((Work)))) :duration_bounds [1 2])";
    let model = self::model(one);
    assert_eq!(model.rules.len(), 1);
    assert_eq!(timelines(&model, &model.rules[0].master), ["r2.Work_SV"]);
}

#[test]
fn literals_variables_and_wildcards_are_told_apart() {
    let model = model(
        "(Define_Constant *rock* rock)
         (Define_Compatibility (SINGLE ((Rover Work_SV) ((Work (*rock* ?_ -> ?d))))))
         (Define_Compatibility (SINGLE ((Rover Work_SV) ((Work)))))",
    );
    let rock = model
        .symbols
        .iter()
        .position(|name| name == "rock")
        .expect("it is there");
    assert_eq!(
        model.rules[0].master.arguments,
        [
            Argument::Value(rock as Value),
            Argument::Any,
            Argument::Variable(0)
        ]
    );
    assert_eq!(model.rules[2].master.arguments, [Argument::Any; 3]);
    assert_eq!(model.rules[0].variables[0].of, TRUTH);
}

#[test]
fn what_comes_before_is_a_condition_of_an_executive() {
    let rule = |flag: &str, kind: &str| {
        std::format!(
            "(Define_Compatibility (SINGLE ((Rover Work_SV) ((Work))))
              :compatibility_spec ({kind} {flag} (SINGLE ((Rover Position_SV) ((At))))))"
        )
    };
    let condition = |text: &str| {
        let model = model(text);
        relation(&model.rules[0].body).condition
    };
    assert!(!condition(&rule("", "met_by")));
    assert!(condition(&rule(":condition", "met_by")));
    assert!(condition(&rule(":condition", "meets")));
    let text = "(Define_Model m :profile executive)
        (Define_Object_Class R :state_variables ((State A_SV)))
        (Define_Predicate P ()) (Define_Member_Values (R A_SV) (P) :default (P ()))
        (Define_Compatibility (SINGLE ((R A_SV) ((P)))) :compatibility_spec (OR
         (contained_by (SINGLE ((R A_SV) ((P))))) (meets (SINGLE ((R A_SV) ((P)))))))";
    let model = read_model("m", text, &Options::default())
        .ok()
        .expect("it is right");
    let Body::Any(parts, _) = &model.rules[0].body else {
        panic!("{:?}", model.rules[0].body)
    };
    assert!(relation(&parts[0]).condition && !relation(&parts[1]).condition);
}

#[test]
fn labels_name_the_tokens_that_relations_are_said_of() {
    let model = model(
        "(Define_Compatibility (SINGLE ((Rover Work_SV) ((Work))))
          :constraints (<= (end a) (start b)) (= (duration) 5)
          :compatibility_spec (AND
           (contains [2 inf] (LABEL a (SINGLE ((Rover Position_SV) ((At (base)))))))
           (before [5 ?gap] a (LABEL b (SINGLE ((Rover Position_SV) ((At (rock)))))))
           (temporaldistance (end b) [-3 inf] (end master))))",
    );
    let rule = &model.rules[0];
    let Body::All(parts) = &rule.body else {
        panic!("{:?}", rule.body)
    };
    let first = relation(&parts[0]);
    assert!(matches!(first.target, Target::New(_, 1)));
    assert_eq!(
        (first.distances[0].min, first.distances[1].min),
        (Bound::Value(2), Bound::Value(0))
    );
    let second = relation(&parts[1]);
    assert_eq!(second.anchor, 1);
    assert_eq!(second.distances[0].max, Bound::Variable(0));
    let third = relation(&parts[2]);
    assert_eq!((third.kind, third.anchor), (RelationKind::Distance, 2));
    assert!(matches!(third.target, Target::Label(0)));
    let Distance {
        from,
        to,
        min,
        max,
        backward,
    } = third.distances[0];
    assert_eq!((from, to, backward), (End::Finish, End::Finish, false));
    assert_eq!((min, max), (Bound::Value(-3), Bound::None));
    assert_eq!(
        rule.relationships[0].operands,
        [Operand::Finish(1), Operand::Start(2)]
    );
    assert_eq!(
        rule.relationships[1].operands,
        [Operand::Duration(0), Operand::Value(5)]
    );
}

#[test]
fn a_decomposition_contains_its_parts_in_their_order() {
    let token = "(SINGLE ((Rover Position_SV) ((At))))";
    let model = model(&std::format!(
        "(Define_Decomposition (SINGLE ((Rover Work_SV) ((Work))))
          :into (seq [1 4] {token} (par {token} (seq {token} {token})) {token}))"
    ));
    let Body::All(parts) = &model.rules[0].body else {
        panic!("{:?}", model.rules[0].body)
    };
    let (mut within, mut order) = (Vec::new(), Vec::new());
    for part in parts {
        let relation = relation(part);
        match relation.target {
            Target::New(_, label) => {
                assert_eq!(
                    (relation.kind, relation.anchor),
                    (RelationKind::Contains, 0)
                );
                within.push(label);
            }
            Target::Label(label) => {
                assert_eq!(relation.kind, RelationKind::Before);
                order.push((relation.anchor, label, relation.distances[0].max));
            }
        }
    }
    assert_eq!(within, [1, 2, 3, 4, 5]);
    let near = Bound::Value(4);
    assert_eq!(
        order,
        [
            (3, 4, Bound::None),
            (1, 2, near),
            (1, 3, near),
            (2, 5, near),
            (4, 5, near)
        ]
    );
    let choice = "(Define_Decomposition (SINGLE ((Rover Work_SV) ((Work))))
        :into (OR (par (SINGLE ((Rover Position_SV) ((At)))))
         (seq (SINGLE ((Lander Mast_SV) ((Up)))))))";
    let model = self::model(choice);
    assert!(matches!(&model.rules[0].body, Body::Any(parts, _) if parts.len() == 2));
}

#[test]
fn comparisons_and_functions_have_their_operands_in_order() {
    let model = model(
        "(Define_Function mine 3)
         (Define_Compatibility (SINGLE ((Rover Work_SV) ((Work))))
          :parameter_functions (mine (?a ?b) max (?a ?b ?c))
          :constraints (> ?a 3) (>= ?b ?a) (product 2 ?a ?b))"
            .replace("(?a ?b) max", "(?a ?b ?x) max")
            .as_str(),
    );
    let rule = &model.rules[0];
    let [a, b] = [0, 1].map(Operand::Variable);
    let kinds: Vec<RelationshipKind> = rule.relationships.iter().map(|of| of.kind).collect();
    let name = |at: usize| match kinds[at] {
        RelationshipKind::Function(function) => &*model.functions[function].name,
        kind => panic!("{kind:?}"),
    };
    assert_eq!((name(0), name(1)), ("mine", "max"));
    assert_eq!(
        kinds[2..],
        [
            RelationshipKind::Less,
            RelationshipKind::AtMost,
            RelationshipKind::Product
        ]
    );
    assert_eq!(rule.relationships[2].operands, [Operand::Value(3), a]);
    assert_eq!(rule.relationships[3].operands, [a, b]);
    let mine = model
        .functions
        .iter()
        .find(|of| of.name == "mine")
        .expect("it is declared");
    assert_eq!((mine.call)(&[1, 2]), None);
}

#[test]
fn programs_give_functions_their_bodies() {
    let mut options = Options::default();
    options
        .functions
        .register("mine", 2, |inputs| Some(inputs[0] + 1));
    let text = std::format!("{BASE}(Define_Function mine 2)");
    let model = read_model("m", &text, &options).ok().expect("it is right");
    let mine: Vec<&Function> = model
        .functions
        .iter()
        .filter(|of| of.name == "mine")
        .collect();
    assert_eq!(mine.len(), 1);
    assert_eq!((mine[0].call)(&[1]), Some(2));
}

#[test]
fn a_search_is_told_what_to_do_first_and_what_not_at_all() {
    let model = model(
        "(Define_Search_Control :subgoal_order ((Rover Work_SV) Work) ((Lander Mast_SV) Up)
          :slot_order ((r2 Work_SV) Work latest) :leave_unbound (Work ?place) (Work))",
    );
    let work = model
        .predicates
        .iter()
        .position(|of| of.name == "Work")
        .expect("it is there");
    let up = model
        .predicates
        .iter()
        .position(|of| of.name == "Up")
        .expect("it is there");
    assert_eq!(model.control.subgoals, [(1, work), (3, work), (4, up)]);
    assert_eq!(model.control.slots, [(3, work, SlotOrder::Latest)]);
    assert_eq!(model.control.unbound, [(work, 0), (work, 2)]);
}

#[test]
fn a_recurring_goal_at_the_closing_instant_is_there_once() {
    let goals = |times: &str| -> Vec<(String, Span)> {
        let text = "(Goal g (SINGLE ((r1 Position_SV) ((At (base))))) :mandatory ";
        let problem = problem(&std::format!("{text}{times})"));
        problem
            .goals
            .into_iter()
            .map(|goal| (goal.name, goal.start))
            .collect()
    };
    let at = |number: usize, tick| (std::format!("g_{number}"), Span::exactly(tick));
    assert_eq!(
        goals(":every 30 :from 10 :to 70"),
        [at(1, 10), at(2, 40), at(3, 70)]
    );
    assert_eq!(goals(":every 30 :from 10 :to 69"), [at(1, 10), at(2, 40)]);
    assert_eq!(goals(":every 30 :from 10 :to 10"), [at(1, 10)]);
    assert_eq!(goals(":every 50"), [at(1, 0), at(2, 50), at(3, 100)]);
    // Without an end, those that fit.
    assert_eq!(goals(":every 50 :duration 1"), [at(1, 0), at(2, 50)]);
    let within = |number: usize, min, max| (std::format!("g_{number}"), Span::new(min, max));
    let expected = [within(1, 0, 20), within(2, 40, 70), within(3, 90, 100)];
    assert_eq!(goals(":every 50 :start [-10 20]"), expected);
}

#[test]
fn a_problem_says_what_is_and_what_is_wanted() {
    let problem = problem(
        "(Fact (SINGLE ((r1 Position_SV) ((At (?somewhere))))) :end [10 20])
         (Goal a (SINGLE ((Rover Work_SV) ((Work (rock r2 -> ?d))))) :end [-inf 50] :weight -2)
         (Goal b (SINGLE ((?r Position_SV) ((At (base))))) :duration 5 :mandatory)
         (Combination ab (b a) :weight 1.5)
         (Order (contains [1 2] a b))
         (Level (r2 battery) 3)
         (Change (Lander store) 7 -1)",
    );
    let fact = &problem.facts[0];
    assert_eq!((fact.timeline, &fact.values[..]), (0, &[None][..]));
    assert_eq!(
        (fact.start, fact.finish),
        (Span::exactly(0), Span::new(10, 20))
    );
    let [a, b] = &problem.goals[..] else {
        panic!("{:?}", problem.goals)
    };
    assert_eq!(
        (a.weight, a.finish, &a.pattern.timelines[..]),
        (Some(-2.0), Span::new(0, 50), &[1, 3][..])
    );
    assert_eq!(
        (b.weight, b.duration, b.pattern.object),
        (None, Span::exactly(5), Some(0))
    );
    assert_eq!(problem.combinations[0].goals, [1, 0]);
    assert_eq!(problem.orders[0].distances[0].max, Bound::Value(2));
    assert_eq!(
        (&problem.initial[..], &problem.changes[..]),
        (&[(1, 3)][..], &[(4, 7, -1)][..])
    );
}

#[test]
fn the_normal_form_of_a_model_means_the_same() {
    // Without the places, which a layout changes.
    let told = |text: &str| {
        let model = read_model("m", text, &Options::default())
            .value
            .expect("it is right");
        let told = std::format!("{model:?}");
        let mut parts = told.split("Position {");
        let first = parts.next().unwrap_or_default().to_owned();
        parts.fold(first, |all, part| {
            all + part.split_once('}').map_or("", |(_, rest)| rest)
        })
    };
    for text in [FIGURE_5, ROVER, EXECUTIVE] {
        let squeezed: Vec<&str> = text.lines().map(str::trim).collect();
        let squeezed = squeezed.join("\n");
        let normal = super::super::format(&squeezed).expect("it is well formed");
        assert_eq!(told(&normal), told(text));
    }
}

#[test]
fn the_same_text_gives_the_same_tables() {
    let told = || std::format!("{:?}", read_model("m", ROVER, &Options::default()));
    assert_eq!(told(), told());
}
