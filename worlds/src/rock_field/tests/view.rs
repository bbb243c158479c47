//! What stands in the way, what is an obstacle, what a beam sees, and what lies near.

use nalgebra::Point3;
use proptest::prelude::*;

use super::super::*;
use super::{field, of_seed};

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
