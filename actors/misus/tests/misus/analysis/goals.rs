//! Goals: revisions lead where they should, and follow what is read.

use farside::random::RandomKey;
use farside_misus::analysis::goals::{Goal, GoalId, Observation, Target, Wishes};
use farside_misus::analysis::learned::Learned;
use farside_misus::analysis::library::ReferenceLibrary;
use farside_misus::analysis::mixture::FitSettings;
use farside_misus::analysis::objective::Objective;
use farside_misus::analysis::prioritise::{Prioritiser, PrioritiserSettings};
use farside_worlds::spectra::wavelength_grid_nm;
use proptest::prelude::*;

use super::field;

fn wishes(goals: &[(u32, bool, f64)]) -> Wishes {
    let mut wishes = Wishes::default();
    for &(rock, is_image, weight) in goals {
        let observation = match is_image {
            true => Observation::PointImage,
            false => Observation::PointSpectrum,
        };
        let target = Target::Rock(rock);
        let id = GoalId {
            target,
            observation,
        };
        let position_m = [f64::from(rock), 0.0];
        let goal = Goal {
            id,
            position_m,
            weight,
        };
        wishes.goals.insert(id, goal);
    }
    let ids: Vec<GoalId> = wishes.goals.keys().copied().collect();
    for pair in ids.windows(2) {
        wishes.combinations.insert(pair.to_vec(), 1.25);
    }
    wishes
}

proptest! {
    #[test]
    fn a_revision_leads_from_one_to_the_other(
        before in prop::collection::vec((0u32..6, any::<bool>(), 0.1f64..2.0), 0..8),
        after in prop::collection::vec((0u32..6, any::<bool>(), 0.1f64..2.0), 0..8),
    ) {
        let (before, after) = (wishes(&before), wishes(&after));
        let revision = before.revision_to(&after, 0.0);
        let mut revised = before.clone();
        revised.apply(&revision);
        prop_assert_eq!(&revised, &after);
        prop_assert!(after.revision_to(&after, 0.0).is_empty());
        // Each goal is told once.
        let told = revision.added.len() + revision.changed.len() + revision.withdrawn.len();
        prop_assert!(told <= before.goals.len() + after.goals.len());
    }
}

#[test]
fn goals_follow_what_is_read() {
    let basis = ReferenceLibrary::mixed(&wavelength_grid_nm(), 300)
        .basis()
        .unwrap();
    let field = field::field(6, 40);
    let mut stream = RandomKey::new(1).stream();
    let mut rows: Vec<_> = (0..40)
        .map(|rock| {
            let image = field::textural(&field, rock, 0.1, &mut stream);
            field::row(&field, rock, rock, None, Some(image))
        })
        .collect();
    let learn = |rows: &[_]| Learned::from_rows(rows, &FitSettings::default()).unwrap();
    let settings = PrioritiserSettings::default();
    let mut prioritiser = Prioritiser::new(settings);
    let learned = learn(&rows);
    let first = prioritiser.revise(&learned, Objective::Distribution);
    assert!(first.withdrawn.is_empty() && !first.added.is_empty());
    for observation in [
        Observation::PanoramicImage,
        Observation::PanoramicSpectrum,
        Observation::PointImage,
        Observation::PointSpectrum,
    ] {
        assert!(
            first
                .added
                .iter()
                .any(|goal| goal.id.observation == observation),
            "{first:?}"
        );
    }
    let wishes = prioritiser.wishes();
    assert!(!wishes.combinations.is_empty());
    for (goals, &factor) in &wishes.combinations {
        assert!(goals.len() >= 2 && goals.is_sorted() && factor > 0.0);
        assert!(goals.iter().all(|id| wishes.goals.contains_key(id)));
    }
    assert!(
        prioritiser
            .revise(&learned, Objective::Distribution)
            .is_empty()
    );

    // The rock wished for most is read: that wish is withdrawn, and others are not worth the same.
    let spectra = first
        .added
        .iter()
        .filter(|g| g.id.observation == Observation::PointSpectrum);
    let best = spectra
        .max_by(|a, b| a.weight.total_cmp(&b.weight))
        .unwrap();
    let Target::Rock(rock) = best.id.target else {
        panic!("a spectrum of a square: {best:?}");
    };
    let spectral = field::spectral(&field, &basis, rock as usize, field::NOISE, &mut stream);
    rows.push(field::row(&field, 40, rock as usize, Some(spectral), None));
    let second = prioritiser.revise(&learn(&rows), Objective::Distribution);
    assert!(second.withdrawn.contains(&best.id), "{second:?}");
    assert!(!prioritiser.wishes().goals.contains_key(&best.id));
}
