//! What is proved of rules, against all values gone through one by one.

use proptest::prelude::*;

use super::*;

/// A comparison of two of three variables, or of one and a number.
#[derive(Clone, Debug)]
struct Comparison {
    word: &'static str,
    left: usize,
    /// A variable, or a number.
    right: Result<usize, Value>,
}

impl Comparison {
    fn text(&self) -> String {
        let right = match self.right {
            Ok(variable) => std::format!("?v{variable}"),
            Err(number) => number.to_string(),
        };
        std::format!("({} ?v{} {right})", self.word, self.left)
    }

    fn holds(&self, values: &[Value]) -> bool {
        let right = self
            .right
            .map_or_else(|number| number, |variable| values[variable]);
        let left = values[self.left];
        match self.word {
            "=" => left == right,
            "!=" => left != right,
            "<" => left < right,
            "<=" => left <= right,
            ">" => left > right,
            _ => left >= right,
        }
    }
}

fn comparisons(words: &'static [&'static str], most: Value) -> impl Strategy<Value = Comparison> {
    let right = prop_oneof![(0..3_usize).prop_map(Ok), (-1..=most + 1).prop_map(Err)];
    let parts = (0..words.len(), 0..3_usize, right);
    parts.prop_map(|(word, left, right)| Comparison {
        word: words[word],
        left,
        right,
    })
}

/// All values of three parameters.
fn all(tops: [Value; 3]) -> impl Iterator<Item = [Value; 3]> {
    let [a, b, c] = tops;
    (0..=a).flat_map(move |x| (0..=b).flat_map(move |y| (0..=c).map(move |z| [x, y, z])))
}

/// The word of a value of the parameter `place`: a truth value, a symbol or a number.
fn word(place: usize, value: Value) -> String {
    match place {
        0 => if value == 0 { "False" } else { "True" }.to_owned(),
        1 => std::format!("s{value}"),
        _ => value.to_string(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1_000))]

    /// A rule whose comparisons cannot all hold is an error, and no other one is.
    #[test]
    fn constraints_that_cannot_hold_are_found(
        given in prop::collection::vec(comparisons(&["=", "<", "<=", ">", ">="], 3), 0..6),
    ) {
        let text: String = given.iter().map(Comparison::text).collect();
        let text = std::format!(
            "(Define_Object_Class R :state_variables ((Free A_SV))) (Define_Type N [0 3])
            (Define_Predicate P ((N ?a) (N ?b) (N ?c))) (Define_Member_Values (R A_SV) (P))
            (Define_Compatibility (SINGLE ((R A_SV) ((P (?v0 ?v1 ?v2))))) :constraints {text})"
        );
        let read = read_model("m", &text, &Options::default());
        let can = all([3, 3, 3]).any(|values| given.iter().all(|one| one.holds(&values)));
        prop_assert_eq!(read.value.is_some(), can, "{}", shown(&read));
    }

    /// An ending that no guard covers is an error, and a model without one is right.
    #[test]
    fn endings_that_nothing_follows_are_found(
        rules in prop::collection::vec(
            (
                prop::array::uniform3(prop::option::weighted(0.1, 0..2_i64)),
                prop::option::of(comparisons(&["=", "!=", "<", "<=", ">", ">="], 8)),
            ),
            0..7,
        ),
        top in prop_oneof![Just(9_i64), Just(900)],
    ) {
        let mut text = std::format!(
            "(Define_Model m :profile executive)
            (Define_Object_Class R :state_variables ((State A_SV)))
            (Define_Type S (s0 s1 s2)) (Define_Type N [0 {top}])
            (Define_Predicate P (-> (Boolean ?a) (S ?b) (N ?c)))
            (Define_Member_Values (R A_SV) (P))\n"
        );
        let mut guards: Vec<([Option<Value>; 3], Option<Comparison>)> = Vec::new();
        for (literals, comparison) in rules {
            // Of numbers only, with a number: literals leave no variable to compare.
            let comparison = comparison.filter(|one| one.right.is_err() && literals[2].is_none());
            let comparison = comparison.map(|one| Comparison { left: 2, ..one });
            let arguments: Vec<String> = literals
                .iter()
                .enumerate()
                .map(|(place, literal)| {
                    literal.map_or(std::format!("?v{place}"), |value| word(place, value))
                })
                .collect();
            let when = comparison.as_ref().map_or(String::new(), |one| {
                std::format!(":when {}", one.text())
            });
            text += &std::format!(
                "(Define_Compatibility (SINGLE ((R A_SV) ((P (-> {}))))) :duration_bounds [1 2] {when}
                 :compatibility_spec (meets (SINGLE ((R A_SV) ((P))))))\n",
                arguments.join(" ")
            );
            guards.push((literals, comparison));
        }
        let read = read_model("m", &text, &Options::default());
        let covered = all([1, 2, top]).all(|ending| {
            guards.iter().any(|(literals, comparison)| {
                let mut pairs = literals.iter().zip(ending);
                pairs.all(|(literal, value)| literal.is_none_or(|literal| literal == value))
                    && comparison.as_ref().is_none_or(|one| one.holds(&ending))
            })
        });
        prop_assert_eq!(read.value.is_some(), covered, "{}\n{}", text, shown(&read));
    }
}
