//! How classes of rock are told apart in pictures: by colour, and by shape for who sees no colours;
//! and which true class a learnt one is drawn as.

use farside_actors::figure::svg::path;
use farside_worlds::RockField;

use crate::analysis::scores::matched_classes;
use crate::messages::FieldModel;

/// How many colours there are.
pub(super) const COLOURS: usize = 8;

/// The outline of a rock of a class.
pub(super) fn shape(class: usize, (x, y): (f64, f64), radius: f64) -> String {
    let corners = |sides: u32, turned: f64, wide: f64, high: f64| {
        let corner = |i: u32| {
            let angle = (f64::from(i) + turned) / f64::from(sides) * std::f64::consts::TAU;
            (
                x + wide * radius * libm::sin(angle),
                y - high * radius * libm::cos(angle),
            )
        };
        format!("{}Z", path((0..sides).map(corner)))
    };
    match class % COLOURS {
        0 => corners(20, 0.0, 1.0, 1.0),
        1 => corners(4, 0.5, 1.25, 1.25),
        2 => corners(3, 0.0, 1.3, 1.3),
        3 => corners(4, 0.0, 1.3, 1.3),
        4 => corners(3, 0.5, 1.3, 1.3),
        5 => corners(6, 0.0, 1.15, 1.15),
        6 => corners(4, 0.5, 1.7, 0.8),
        _ => corners(4, 0.5, 0.8, 1.7),
    }
}

/// For each learnt class the true class that it is drawn as, so that as many rocks as possible have one
/// colour in both panels. Classes that are learnt and not there have colours of their own.
pub(super) fn matched(model: &FieldModel, field: &RockField) -> Vec<usize> {
    let of_rocks = model.rocks.iter().map(|label| label.class as usize);
    let learnt: Vec<usize> = of_rocks.collect();
    let truth = field.truth();
    let truth: Vec<usize> = truth
        .classes()
        .iter()
        .map(|class| usize::from(*class))
        .collect();
    let classes = field.classes().len().max(model.classes as usize);
    matched_classes(&learnt, &truth, classes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::RockLabel;
    use farside_worlds::rock_field::RockFieldSettings;

    fn model(classes: u32, class_of: impl Fn(usize) -> u32, rocks: usize) -> FieldModel {
        let label = |rock| RockLabel {
            class: class_of(rock),
            confidence: 1.0,
            image: true,
            spectrum: true,
        };
        FieldModel {
            classes,
            rocks: (0..rocks).map(label).collect(),
            ..FieldModel::default()
        }
    }

    #[test]
    fn learnt_classes_are_drawn_as_the_true_ones_they_are_mostly_of() {
        let field = RockField::generate(&RockFieldSettings::default()).unwrap();
        let truth = field.truth().classes().to_vec();
        let all = field.classes().len() as u32;
        // The same classes with other numbers.
        let turned = |rock: usize| (u32::from(truth[rock]) + 1) % all;
        let drawn = matched(&model(all, turned, truth.len()), &field);
        for (rock, class) in truth.iter().enumerate() {
            assert_eq!(drawn[turned(rock) as usize], usize::from(*class));
        }
        // One class cut in two: the smaller part is drawn as none of the true ones.
        let cut = |rock: usize| match (truth[rock], rock % 4) {
            (0, 0) => all,
            (class, _) => u32::from(class),
        };
        let drawn = matched(&model(all + 1, cut, truth.len()), &field);
        assert_eq!(drawn, [0, 1, 2, 3, all as usize]);
    }

    #[test]
    fn every_class_has_a_shape_of_its_own() {
        let shapes: std::collections::BTreeSet<String> = (0..COLOURS)
            .map(|class| shape(class, (0.0, 0.0), 5.0))
            .collect();
        assert_eq!(shapes.len(), COLOURS);
    }
}
