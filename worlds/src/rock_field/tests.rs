//! Fields are as their settings say, on every machine, and beams see what lies in them.

use std::sync::Arc;

use farside::random::RandomKey;
use nalgebra::Point3;
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
        (StoryKind::Strata, 0x93df_7add_aac6_7d58_0adb_6a3b_b53d_6ddc),
        (StoryKind::Ejecta, 0xf429_7cf3_ecf0_5881_9450_895c_912a_b33c),
        (StoryKind::Lava, 0x39bc_a02b_1682_2b7d_3421_ff5d_a4e6_4a29),
        (
            StoryKind::Outwash,
            0xcc94_a824_b25d_800d_b013_8f32_905f_3488,
        ),
        (
            StoryKind::Uniform,
            0x36d5_6c48_d80b_fb63_2abb_54c6_af35_2ac9,
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
fn hills_and_boulders_block_the_view() {
    let bare = RockFieldSettings {
        hills: 1,
        hill_height_m: 6.0,
        boulder_least_m: 100.0,
        ..of_seed(3)
    };
    let hill = field(bare.clone());
    let terrain = hill.terrain();
    let top = (0..terrain.heights_m().len())
        .max_by(|&a, &b| terrain.heights_m()[a].total_cmp(&terrain.heights_m()[b]))
        .unwrap();
    let top_m = terrain.sample_position_m(top % terrain.columns(), top / terrain.columns());
    let (a, b) = (
        terrain.antenna_m(top_m.x - 20.0, top_m.y, 1.5),
        terrain.antenna_m(top_m.x + 20.0, top_m.y, 1.5),
    );
    assert!(!terrain.line_of_sight(a, b));
    let flat = field(RockFieldSettings { hills: 0, ..bare });
    let (a, b) = (
        flat.terrain().antenna_m(top_m.x - 20.0, top_m.y, 1.5),
        flat.terrain().antenna_m(top_m.x + 20.0, top_m.y, 1.5),
    );
    assert!(flat.terrain().line_of_sight(a, b));

    // A boulder hides what is behind it from a low antenna; not from a mast above it; without boulders
    // in the terrain it hides nothing.
    let rocky = RockFieldSettings {
        hills: 0,
        ..of_seed(3)
    };
    let boulders = field(rocky.clone());
    let largest = (0..90).max_by(|&a, &b| {
        let diameter_m = |rock: usize| boulders.rocks()[rock].diameter_m;
        diameter_m(a).total_cmp(&diameter_m(b))
    });
    let boulder = boulders.rocks()[largest.unwrap()];
    assert!(boulder.diameter_m > 1.0);
    let view = |field: &RockField, mast_m: f64| {
        let end = |dx_m: f64| {
            let (x_m, y_m) = (boulder.position_m.x + dx_m, boulder.position_m.y);
            Point3::new(x_m, y_m, field.ground_m(x_m, y_m) + mast_m)
        };
        let reach_m = boulder.diameter_m + 1.0;
        field.terrain().line_of_sight(end(-reach_m), end(reach_m))
    };
    assert!(!view(&boulders, 0.25 * boulder.diameter_m));
    assert!(view(&boulders, 2.0 * boulder.diameter_m));
    assert!(view(
        &field(RockFieldSettings {
            boulder_least_m: 100.0,
            ..rocky
        }),
        0.25 * boulder.diameter_m
    ));
    // The boulder itself is seen, from all sides.
    for (dx_m, dy_m) in [(-8.0, 0.0), (8.0, 0.0), (0.0, 8.0), (0.0, -8.0)] {
        let from_m = boulders.terrain().antenna_m(
            boulder.position_m.x + dx_m,
            boulder.position_m.y + dy_m,
            1.5,
        );
        let others = boulders
            .near(from_m.xy(), 9.0)
            .filter(|&rock| boulders.rocks()[rock].diameter_m >= 1.0);
        assert!(others.count() > 1 || boulders.sees(from_m, largest.unwrap()));
    }
}

#[test]
fn obstacles_are_boulders_and_steep_places() {
    let field = field(RockFieldSettings {
        hill_height_m: 12.0,
        ..of_seed(2)
    });
    for rock in field.rocks() {
        let at_m = rock.position_m;
        let expected = rock.diameter_m >= 1.0;
        assert!(!expected || field.hazard(at_m.x, at_m.y) == Hazard::Boulder);
        let beside = field.hazard(at_m.x + 0.51 * rock.diameter_m, at_m.y);
        assert!(beside != Hazard::Boulder || expected || field.near(at_m, 5.0).count() > 1);
    }
    let steep = (0..100 * 100).filter(|i| {
        let (x_m, y_m) = (f64::from(i % 100) - 49.5, f64::from(i / 100) - 49.5);
        field.hazard(x_m, y_m) == Hazard::Steep
    });
    let share = steep.count() as f64 / 1e4;
    assert!(
        (0.001..0.3).contains(&share),
        "{share} of the ground is steep"
    );
}

#[test]
fn a_beam_mixes_more_the_farther_it_comes_from() {
    let field = field(RockFieldSettings {
        hills: 0,
        ..of_seed(11)
    });
    let rock = (0..90)
        .find(|&rock| {
            let rock = &field.rocks()[rock];
            field.near(rock.position_m, 3.0).count() == 1 && rock.diameter_m < 1.0
        })
        .unwrap();
    let aim_m = field.rocks()[rock].position_m;
    let half_angle_rad = 0.02;
    let mut before = 1.0;
    for away_m in [2.0, 5.0, 10.0, 20.0, 40.0] {
        let from_m = Point3::new(
            aim_m.x - away_m,
            aim_m.y,
            field.ground_m(aim_m.x - away_m, aim_m.y) + 1.5,
        );
        let footprint = field.footprint(from_m, aim_m, half_angle_rad);
        let sum = footprint.ground + footprint.rocks.iter().map(|(_, share)| share).sum::<f64>();
        assert!((sum - 1.0).abs() < 1e-12);
        let share = footprint.share(rock);
        assert!(
            share <= before + 1e-12,
            "{away_m} m: {share} after {before}"
        );
        before = share;
    }
    assert!(
        before < 0.9,
        "from 40 m the beam still sees {before} of the rock alone"
    );
    // Ground alone, where no rock is.
    let from_m = Point3::new(0.0, 0.0, field.ground_m(0.0, 0.0) + 1.5);
    let ground = field.footprint(from_m, Point2::new(2.0, 0.0), 1e-3);
    assert_eq!(
        ground,
        Footprint {
            rocks: Vec::new(),
            ground: 1.0
        }
    );
    let mut spectrum = vec![0.0; 101];
    field.mixed_reflectance(&ground, &mut spectrum);
    assert_eq!(spectrum, field.ground_reflectance());
    assert_eq!(field.mixed_texture(&ground), field.ground_texture());
}

#[test]
fn cover_is_the_area_of_the_rocks() {
    let field = field(RockFieldSettings {
        rocks: FieldRocks::FromDiameter(0.2),
        clear_radius_m: 0.0,
        ..of_seed(4)
    });
    let area_m2: f64 = field
        .rocks()
        .iter()
        .map(|rock| std::f64::consts::FRAC_PI_4 * rock.diameter_m * rock.diameter_m)
        .sum();
    // A circle around all of the field has all rocks in it.
    let all = field.rock_cover(Point2::origin(), 100.0) * std::f64::consts::PI * 1e4;
    assert!((all / area_m2 - 1.0).abs() < 1e-9);
    let rock = field.rocks()[7];
    assert_eq!(
        field.rock_cover(rock.position_m, 0.4 * rock.diameter_m),
        1.0
    );
    assert_eq!(field.rock_cover(Point2::new(500.0, 0.0), 1.0), 0.0);
    assert_eq!(field.rock_cover(Point2::origin(), 0.0), 0.0);
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
    assert!(broken.contains("sum to 1.88; expected 1"), "{broken}");
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

    /// What the grid finds is what a scan of all rocks finds.
    #[test]
    fn near_is_a_scan(
        seed in 0..50u64,
        count in 1usize..400,
        (x_m, y_m) in (-80.0..80.0f64, -80.0..80.0f64),
        radius_m in 0.0..150.0f64,
    ) {
        let field = field(RockFieldSettings {
            rocks: FieldRocks::Exactly(count),
            resolution_m: 10.0,
            ..of_seed(seed)
        });
        let center_m = Point2::new(x_m, y_m);
        let found: Vec<usize> = field.near(center_m, radius_m).collect();
        let scan = (0..count).filter(|&rock| (field.rocks()[rock].position_m - center_m).norm() <= radius_m);
        prop_assert_eq!(found, scan.collect::<Vec<_>>());
    }

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

    /// The shares of a beam are a whole, and what it sees is between what is there, from anywhere.
    #[test]
    fn a_beam_sees_a_whole(
        (fx, fy, fz) in (-60.0..60.0f64, -60.0..60.0f64, -5.0..20.0f64),
        (ax, ay) in (-60.0..60.0f64, -60.0..60.0f64),
        half_angle_rad in prop_oneof![0.0..0.5f64, Just(f64::NAN), Just(-1.0), Just(9.0)],
    ) {
        let field = field(RockFieldSettings { resolution_m: 10.0, ..of_seed(8) });
        let footprint = field.footprint(Point3::new(fx, fy, fz), Point2::new(ax, ay), half_angle_rad);
        let sum = footprint.ground + footprint.rocks.iter().map(|(_, share)| share).sum::<f64>();
        prop_assert!((sum - 1.0).abs() < 1e-9);
        prop_assert!((0.0..=1.0).contains(&footprint.ground));
        let mut spectrum = vec![f64::NAN; 101];
        field.mixed_reflectance(&footprint, &mut spectrum);
        prop_assert!(spectrum.iter().all(|value| (0.0..=1.0).contains(value)));
    }
}
