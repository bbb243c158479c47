//! Fields are as their settings say, on every machine.

mod view;

use std::sync::Arc;

use farside::random::RandomKey;
use proptest::prelude::*;

use super::*;
use crate::geology::Evidence;
use crate::rocks::RockAbundance;
use crate::spectra::{MINERALS, SpectralLibrary};

fn field(settings: RockFieldSettings) -> RockField {
    RockField::generate(&settings).expect("the settings are in order")
}

fn of_seed(seed: u64) -> RockFieldSettings {
    RockFieldSettings {
        seed,
        ..RockFieldSettings::default()
    }
}

/// A hash of all that a field is.
fn digest(field: &RockField) -> u128 {
    let mut hash = 0u128;
    let mut add = |bits: u64| {
        let key = RandomKey::new(hash as u64)
            .number((hash >> 64) as u64)
            .number(bits);
        hash = key.hash();
    };
    for height_m in field.terrain.heights_m() {
        add(height_m.to_bits());
    }
    for (rock, place) in field.rocks.iter().enumerate() {
        for value in [place.position_m.x, place.position_m.y, place.diameter_m] {
            add(value.to_bits());
        }
        let truth = field.truth().rock(rock);
        add(u64::from(truth.class));
        truth
            .fractions
            .iter()
            .for_each(|value| add(value.to_bits()));
        field
            .reflectance(rock)
            .iter()
            .for_each(|value| add(value.to_bits()));
        field
            .texture(rock)
            .iter()
            .for_each(|value| add(value.to_bits()));
    }
    field
        .ground_reflectance()
        .iter()
        .for_each(|value| add(value.to_bits()));
    hash
}

#[test]
fn the_same_settings_give_the_same_field_on_every_machine() {
    let golden = [
        (StoryKind::Strata, 0x32c1_e44f_d1bf_889c_4f76_e362_9c1a_ea21),
        (StoryKind::Ejecta, 0x9488_03d1_a349_df09_fd7c_e73a_e978_7391),
        (StoryKind::Lava, 0x7cdb_5703_8aeb_b490_7633_2d85_6c8c_8128),
        (
            StoryKind::Outwash,
            0xc085_85c0_0939_2338_d5a0_f1d2_6355_6bd0,
        ),
        (
            StoryKind::Uniform,
            0x7fba_0ac8_aad4_0f57_7ee6_fb7c_16a0_0c73,
        ),
    ];
    let found = golden.map(|(story, _)| {
        let settings = RockFieldSettings {
            story,
            ..of_seed(42)
        };
        (story, digest(&field(settings)))
    });
    assert_eq!(found, golden, "{found:#x?}");
    assert_ne!(digest(&field(of_seed(42))), digest(&field(of_seed(43))));
}

#[test]
fn sizes_follow_the_abundance_whatever_the_story() {
    let site = RockAbundance::new(0.10).unwrap();
    for story in StoryKind::ALL {
        let field = field(RockFieldSettings {
            side_m: 300.0,
            abundance: 0.10,
            rocks: FieldRocks::FromDiameter(0.4),
            resolution_m: 5.0,
            story,
            ..of_seed(5)
        });
        for least_m in [0.4, 0.8] {
            let count = field
                .rocks()
                .iter()
                .filter(|rock| rock.diameter_m >= least_m)
                .count() as f64;
            let expected = site.per_m2(least_m) * 300.0 * 300.0;
            let deviations = (count - expected) / libm::sqrt(expected);
            assert!(
                deviations.abs() < 4.0,
                "{}, {least_m} m: {count} of {expected}",
                story.name()
            );
        }
    }
    // Exactly so many are the largest ones of the site.
    let exact = field(RockFieldSettings {
        rocks: FieldRocks::Exactly(500),
        ..of_seed(5)
    });
    let least_m = exact
        .rocks()
        .iter()
        .map(|rock| rock.diameter_m)
        .fold(f64::MAX, f64::min);
    let spirit = RockAbundance::new(0.05).unwrap();
    assert_eq!(exact.rocks().len(), 500);
    let expected = spirit.per_m2(least_m) * 1e4;
    assert!(
        (expected / 500.0 - 1.0).abs() < 0.02,
        "{least_m} m: {expected}"
    );
}

#[test]
fn rocks_lie_apart_and_outside_the_clear() {
    for seed in 0..20 {
        let field = field(of_seed(seed));
        for (i, a) in field.rocks().iter().enumerate() {
            assert!(a.position_m.coords.norm() >= 6.0 + 0.5 * a.diameter_m);
            assert!(a.position_m.coords.amax() <= 50.0);
            for b in &field.rocks()[..i] {
                let apart_m = (a.position_m - b.position_m).norm();
                assert!(
                    apart_m >= 0.5 * (a.diameter_m + b.diameter_m),
                    "seed {seed}"
                );
            }
        }
        assert!(!field.is_obstacle(0.0, 0.0));
    }
}

/// The share of rocks whose nearest neighbour is of their class, over that of the class counts.
fn togetherness(field: &RockField) -> f64 {
    let classes = field.truth().classes();
    let rocks = field.rocks();
    let same = (0..rocks.len()).filter(|&i| {
        let distance = |j: usize| (rocks[j].position_m - rocks[i].position_m).norm();
        let others = (0..rocks.len()).filter(|&j| j != i);
        let nearest = others.min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        nearest.is_some_and(|j| classes[i] == classes[j])
    });
    let mut counts = vec![0.0; field.classes().len()];
    classes
        .iter()
        .for_each(|&class| counts[usize::from(class)] += 1.0);
    let count = rocks.len() as f64;
    let expected: f64 = counts
        .iter()
        .map(|of| of * (of - 1.0) / (count - 1.0))
        .sum();
    same.count() as f64 / expected
}

#[test]
fn stories_bring_rocks_of_a_class_together() {
    let mean = |story| {
        let fields = (0..20).map(|seed| {
            togetherness(&field(RockFieldSettings {
                story,
                ..of_seed(seed)
            }))
        });
        fields.sum::<f64>() / 20.0
    };
    let uniform = mean(StoryKind::Uniform);
    assert!((0.9..1.1).contains(&uniform), "{uniform}");
    for story in [
        StoryKind::Strata,
        StoryKind::Ejecta,
        StoryKind::Lava,
        StoryKind::Outwash,
    ] {
        let together = mean(story);
        assert!(together > 1.12, "{}: {together}", story.name());
    }
}

/// The correlation of the ranks of sizes with those of nearness to where the story has large rocks.
#[test]
fn large_rocks_lie_where_the_story_has_them() {
    let ranks = |values: Vec<f64>| {
        let mut order: Vec<usize> = (0..values.len()).collect();
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
        let mut ranks = vec![0.0; values.len()];
        order
            .iter()
            .enumerate()
            .for_each(|(rank, &i)| ranks[i] = rank as f64);
        ranks
    };
    let correlation = |story| {
        let of = |seed| {
            let field = field(RockFieldSettings {
                story,
                ..of_seed(seed)
            });
            let sizes = ranks(field.rocks().iter().map(|rock| rock.diameter_m).collect());
            let trend = |rock: &Rock| field.truth().story().size_trend(rock.position_m);
            let trends = ranks(field.rocks().iter().map(trend).collect());
            let mean = 0.5 * (sizes.len() as f64 - 1.0);
            let products = sizes
                .iter()
                .zip(&trends)
                .map(|(a, b)| (a - mean) * (b - mean));
            let squares = sizes.iter().map(|a| (a - mean) * (a - mean));
            products.sum::<f64>() / squares.sum::<f64>()
        };
        (0..10).map(of).sum::<f64>() / 10.0
    };
    assert!(correlation(StoryKind::Outwash) > 0.5);
    assert!(correlation(StoryKind::Ejecta) > 0.4);
    assert!(correlation(StoryKind::Lava) > 0.15);
}

/// The story that laid a field out is found from its rocks: mean likelihoods over draws of the prior.
#[test]
fn stories_can_be_told_apart() {
    let mut right = 0;
    for truth in StoryKind::ALL {
        for seed in 0..3 {
            let field = field(RockFieldSettings {
                story: truth,
                ..of_seed(seed)
            });
            let classes = field.classes().len();
            let mut shares = vec![0.0; classes * field.rocks().len()];
            for (rock, &class) in field.truth().classes().iter().enumerate() {
                shares[rock * classes + usize::from(class)] = 1.0;
            }
            let evidence = Evidence::new(field.rocks(), classes, &shares);
            let mut stream = RandomKey::new(seed).text("prior").stream();
            let mut marginal = |kind| {
                let draws = (0..1000).map(|_| Story::draw(kind, classes, 100.0, &mut stream));
                let logs: Vec<f64> = draws.map(|story| story.log_likelihood(&evidence)).collect();
                let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                most + libm::log(logs.iter().map(|log| libm::exp(log - most)).sum())
            };
            let marginals = StoryKind::ALL.map(&mut marginal);
            let best = (0..5).max_by(|&a, &b| marginals[a].total_cmp(&marginals[b]));
            right += usize::from(best.map(|best| StoryKind::ALL[best]) == Some(truth));
        }
    }
    assert!(right >= 12, "{right} of 15");
}

#[test]
fn a_library_gives_rocks_measured_spectra() {
    let library = Arc::new(SpectralLibrary::builtin());
    let settings = RockFieldSettings {
        spectra: FieldSpectra::Library(Arc::clone(&library)),
        ..of_seed(6)
    };
    let measured = field(settings.clone());
    assert_eq!(measured.minerals(), library.minerals());
    let names: Vec<&str> = measured
        .classes()
        .iter()
        .map(|class| class.name.as_str())
        .collect();
    assert_eq!(
        names,
        ["olivine", "orthopyroxene", "clinopyroxene", "plagioclase"]
    );
    for rock in 0..90 {
        let truth = measured.truth().rock(rock);
        let sample = library.sample(truth.sample.unwrap());
        assert_eq!(sample.dominant_mineral(), usize::from(truth.class));
        assert_eq!(measured.reflectance(rock), sample.reflectance);
        assert_eq!(truth.fractions, sample.fractions);
    }
    // The ground and the places of the rocks are those of mixed spectra with as many classes.
    assert_eq!(measured.terrain(), field(of_seed(6)).terrain());
    let named = |names: &[&str]| {
        let names = names.iter().map(|name| (*name).to_owned()).collect();
        RockField::generate(&RockFieldSettings {
            classes: FieldClasses::Named(names),
            ..settings.clone()
        })
    };
    assert_eq!(named(&["plagioclase"]).unwrap().truth().classes(), [0; 90]);
    let error = named(&["plagioclas"]).unwrap_err().to_string();
    assert!(error.contains("did you mean \"plagioclase\""), "{error}");
    let error = RockField::generate(&RockFieldSettings {
        classes: FieldClasses::Count(5),
        ..settings
    })
    .unwrap_err();
    assert_eq!(error, GeologyError::ClassCount { most: 4, actual: 5 });
}

#[test]
fn settings_out_of_range_are_errors() {
    let error = |change: fn(&mut RockFieldSettings)| {
        let mut settings = RockFieldSettings::default();
        change(&mut settings);
        RockField::generate(&settings)
            .expect_err("it is out of range")
            .to_string()
    };
    assert_eq!(
        error(|s| s.side_m = f64::NAN),
        "side_m must be within 10 and 4000; it is NaN"
    );
    assert_eq!(
        error(|s| s.resolution_m = 0.0),
        "resolution_m must be within 0.1 and 10; it is 0"
    );
    assert_eq!(
        error(|s| s.clear_radius_m = 26.0),
        "clear_radius_m must be within 0 and 25; it is 26"
    );
    assert_eq!(
        error(|s| s.rocks = FieldRocks::Exactly(0)),
        "rocks must be within 1 and 100000; it is 0"
    );
    assert_eq!(
        error(|s| s.abundance = 0.0),
        "rocks must cover over 0 and at most 1 of the ground; they are to cover 0"
    );
    assert!(error(|s| s.rocks = FieldRocks::FromDiameter(f64::NAN)).contains("smallest rocks"));
    assert!(error(|s| s.rocks = FieldRocks::FromDiameter(-1.0)).contains("smallest rocks"));
    assert!(
        error(|s| (s.rocks, s.side_m) = (FieldRocks::FromDiameter(0.02), 4000.0))
            .contains("may hold 100000")
    );
    assert!(error(|s| (s.resolution_m, s.side_m) = (0.1, 4000.0)).contains("may have 16777216"));
    assert!(
        error(|s| (s.abundance, s.side_m, s.clear_radius_m, s.rocks) =
            (1e-4, 10.0, 0.0, FieldRocks::Exactly(90_000)))
        .contains("rocks must be within 1 and")
    );
    assert_eq!(
        error(|s| s.classes = FieldClasses::Count(9)),
        "a field has 1 to 8 classes of rock; 9 were asked for"
    );
    assert_eq!(
        error(|s| s.classes = FieldClasses::Named(Vec::new())),
        "a field has 1 to 64 classes of rock; 0 were asked for"
    );
    assert!(
        error(|s| s.classes = FieldClasses::Named(vec!["norit".to_owned()]))
            .contains("did you mean \"norite\"")
    );
    let twice = error(|s| s.classes = FieldClasses::Named(vec!["norite".to_owned(); 2]));
    assert_eq!(
        twice,
        "the class of rock \"norite\" is given twice; expected each once"
    );
    let broken = error(|s| {
        let mut class = RockClass::builtin("norite").unwrap();
        class.fractions[0] = 0.9;
        s.classes = FieldClasses::Custom(vec![class]);
    });
    assert!(broken.contains("sum to 1.88"), "{broken}");
    let both = error(|s| {
        s.classes = FieldClasses::Custom(vec![RockClass::builtin("norite").unwrap()]);
        s.spectra = FieldSpectra::Library(Arc::new(SpectralLibrary::builtin()));
    });
    assert!(both.contains("not for a field whose spectra come from a library"));
}

/// The cost of a field is bounded by what it is made of, whatever the ground is covered with.
#[test]
fn a_field_full_of_rocks_is_made() {
    let full = field(RockFieldSettings {
        side_m: 30.0,
        abundance: 1.0,
        rocks: FieldRocks::FromDiameter(0.1),
        ..of_seed(1)
    });
    assert!(full.rocks().len() > 5_000, "{}", full.rocks().len());
    assert_eq!(full.rock_cover(Point2::new(9.0, 9.0), 1e-3).fract(), 0.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Fractions are a whole and spectra are shares, whatever the story, the classes and the seed.
    #[test]
    fn rocks_are_whole(seed in any::<u64>(), story in 0usize..5, classes in 1usize..=8) {
        let field = field(RockFieldSettings {
            story: StoryKind::ALL[story],
            classes: FieldClasses::Count(classes),
            resolution_m: 10.0,
            ..of_seed(seed)
        });
        for rock in 0..field.rocks().len() {
            let truth = field.truth().rock(rock);
            prop_assert!(usize::from(truth.class) < classes);
            prop_assert_eq!(truth.fractions.len(), MINERALS.len());
            prop_assert!((truth.fractions.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            prop_assert!(field.reflectance(rock).iter().all(|value| (0.0..=1.0).contains(value)));
            prop_assert!(field.texture(rock).iter().all(|value| (-1.0..=1.0).contains(value)));
        }
    }
}
