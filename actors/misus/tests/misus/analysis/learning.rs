//! Classes are found in surveyed fields, one of them stretched.

use farside_misus::analysis::learned::Learned;
use farside_misus::analysis::library::ReferenceLibrary;
use farside_misus::analysis::mixture::FitSettings;
use farside_misus::analysis::objective::{Stories, StorySettings};
use farside_misus::analysis::scores::adjusted_rand_index;
use farside_worlds::spectra::wavelength_grid_nm;

use super::field;

#[test]
fn classes_of_surveyed_fields_are_found() {
    let library = ReferenceLibrary::mixed(&wavelength_grid_nm(), 300);
    let basis = library.basis().unwrap();
    let seeds = 3..8;
    let indices = seeds.clone().map(|seed| {
        let field = field::field(seed, 90);
        let rows = field::survey(&field, &basis, field::NOISE);
        let learned = Learned::from_rows(&rows, &FitSettings::default()).unwrap();
        adjusted_rand_index(&learned.hard_classes(), &field::truth(&field))
    });
    let mean = indices.sum::<f64>() / seeds.count() as f64;
    assert!(mean >= 0.9, "{mean}");
}

/// What is believed of stories sums to 1, and a surveyed field of beds is taken for one.
#[test]
fn the_story_of_a_surveyed_field_is_believed() {
    let basis = ReferenceLibrary::mixed(&wavelength_grid_nm(), 300)
        .basis()
        .unwrap();
    let field = field::field(4, 90);
    let rows = field::survey(&field, &basis, field::NOISE);
    let learned = Learned::from_rows(&rows, &FitSettings::default()).unwrap();
    let mut stories = Stories::new(StorySettings {
        draws: 100,
        ..StorySettings::default()
    });
    let belief = stories.weigh(&learned);
    assert!((belief.probabilities().iter().sum::<f64>() - 1.0).abs() < 1e-12);
    assert!(
        belief.log_score(field.story()) > libm::log(0.5),
        "{:?}",
        belief.probabilities()
    );
    assert!((0..90).all(|rock| belief.information(rock).is_finite()));
    assert_eq!(belief, stories.weigh(&learned));
}
