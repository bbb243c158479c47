//! How the cells of a study lie: along which factors, and which of them go on an axis.

use std::collections::{BTreeMap, BTreeSet};

use crate::study::results::{Manifest, Scale};
use farside_actors::figure::colours::SERIES;

/// The most plots of one kind for one metric; with more, a choice of them is shown.
pub(super) const PANELS: usize = 6;

/// A factor that takes more than one value.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    /// Its place in the manifest.
    pub(super) factor: usize,
    /// What is written along it.
    pub(super) label: String,
    pub(super) levels: Vec<Level>,
    /// Its values are numbers, and so ordered.
    pub(super) numeric: bool,
    pub(super) scale: Scale,
}

/// A value of a factor.
#[derive(Clone, Debug)]
pub(super) struct Level {
    pub(super) text: String,
    /// The number; the place among the others if it is a word.
    pub(super) value: f64,
}

/// How the cells lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// There is one.
    Single,
    /// All combinations of the levels.
    Grid,
    /// In a row: all factors advance together.
    Row,
    /// Anywhere.
    Scattered,
}

/// The cells and their axes.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) axes: Vec<Axis>,
    pub(super) shape: Shape,
    /// By cell, the level on each axis.
    pub(super) places: Vec<Vec<usize>>,
    wanted: Wanted,
    lookup: BTreeMap<Vec<usize>, usize>,
}

/// The axes that the study gives a place in plots.
#[derive(Clone, Copy, Debug, Default)]
struct Wanted {
    x: Option<usize>,
    series: Option<usize>,
    facet: Option<usize>,
}

impl Wanted {
    /// Of factors that vary; others are on no plot.
    fn new(manifest: &Manifest, axes: &[Axis]) -> Self {
        let axis = |name: &Option<String>| {
            let name = name.as_ref()?;
            let named = |axis: &Axis| manifest.factors[axis.factor].name == *name;
            axes.iter().position(named)
        };
        Wanted {
            x: axis(&manifest.report.x),
            series: axis(&manifest.report.series),
            facet: axis(&manifest.report.facet),
        }
    }

    /// What goes along x, and what makes curves: what the study says, or else the first axis of
    /// numbers and the next that is left.
    fn resolve(self, axes: &[Axis]) -> (usize, Option<usize>) {
        let free = |axis: &usize| Some(*axis) != self.series && Some(*axis) != self.facet;
        let all = || (0..axes.len()).filter(free);
        let numeric = all().find(|axis| axes[*axis].numeric);
        let x = self.x.or(numeric).or(all().next()).unwrap_or(0);
        let next = all().find(|axis| *axis != x);
        (x, self.series.filter(|axis| *axis != x).or(next))
    }
}

/// Cells that go into one plot, as curves over an axis.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    /// What all its cells share: `planner greedy`; empty if there is nothing else.
    pub(super) name: String,
    pub(super) series: Vec<Series>,
}

/// Cells along an axis.
#[derive(Clone, Debug)]
pub(super) struct Series {
    /// What tells it from the others of its panel: a level's text.
    pub(super) name: String,
    /// The cells by level of the axis.
    pub(super) cells: Vec<usize>,
}

/// The axes of curves: what runs along x, what makes curves, and what makes plots.
#[derive(Clone, Debug)]
pub(super) struct Curves {
    pub(super) x: usize,
    pub(super) series: Option<usize>,
    pub(super) panels: Vec<Panel>,
    /// There are more panels or curves than are shown.
    pub(super) more: bool,
}

impl Layout {
    pub(super) fn new(manifest: &Manifest) -> Self {
        let all = (0..manifest.factors.len()).map(|factor| Axis::new(manifest, factor));
        let axes: Vec<Axis> = all.filter(|axis| axis.levels.len() > 1).collect();
        let places: Vec<Vec<usize>> = manifest
            .cells
            .iter()
            .map(|cell| {
                let texts = axes.iter().map(|axis| (axis, cell.texts.get(axis.factor)));
                let place = |(axis, text): (&Axis, Option<&String>)| {
                    let level = |level: &Level| Some(&level.text) == text;
                    axis.levels.iter().position(level).unwrap_or(0)
                };
                texts.map(place).collect()
            })
            .collect();
        let indexed = places.iter().cloned().enumerate();
        let lookup: BTreeMap<Vec<usize>, usize> =
            indexed.map(|(cell, place)| (place, cell)).collect();
        let shape = shape(&axes, &places, &lookup);
        let wanted = Wanted::new(manifest, &axes);
        Layout {
            wanted,
            axes,
            shape,
            places,
            lookup,
        }
    }

    /// The cell at some levels, one for each axis.
    pub(super) fn cell(&self, levels: &[usize]) -> Option<usize> {
        self.lookup.get(levels).copied()
    }

    /// Curves over the first factor of numbers (of words, if there are no others), one for each
    /// level of the next; further factors make further plots; or as the study says. Only cells in a
    /// grid or a row have any.
    pub(super) fn curves(&self) -> Option<Curves> {
        let (x, series) = self.wanted.resolve(&self.axes);
        if self.shape == Shape::Row {
            let levels = 0..self.axes[x].levels.len();
            let cells =
                levels.filter_map(|level| self.places.iter().position(|place| place[x] == level));
            let series = vec![Series {
                name: String::new(),
                cells: cells.collect(),
            }];
            let panels = vec![Panel {
                name: String::new(),
                series,
            }];
            return Some(Curves {
                x,
                series: None,
                panels,
                more: false,
            });
        }
        if self.shape != Shape::Grid {
            return None;
        }
        let others = (0..self.axes.len()).filter(|axis| *axis != x && Some(*axis) != series);
        let others: Vec<usize> = others.collect();
        let all = self.combinations(&others);
        let shown = spread(all.len(), PANELS);
        let mut more = shown.len() < all.len();
        let panels = shown.into_iter().map(|index| {
            let panel = self.panel(x, series, &others, &all[index]);
            let levels = series.map_or(1, |axis| self.axes[axis].levels.len());
            more |= panel.series.len() < levels;
            panel
        });
        let panels = panels.collect();
        Some(Curves {
            x,
            series,
            panels,
            more,
        })
    }

    fn panel(&self, x: usize, series: Option<usize>, others: &[usize], at: &[usize]) -> Panel {
        let named = others.iter().zip(at).map(|(axis, level)| {
            let axis = &self.axes[*axis];
            format!("{} {}", axis.name(), axis.levels[*level].text)
        });
        let mut levels = vec![0; self.axes.len()];
        for (axis, level) in others.iter().zip(at) {
            levels[*axis] = *level;
        }
        let count = series.map_or(1, |axis| self.axes[axis].levels.len());
        let curves = spread(count, SERIES).into_iter().map(|level| {
            if let Some(axis) = series {
                levels[axis] = level;
            }
            let cells = (0..self.axes[x].levels.len()).filter_map(|along| {
                levels[x] = along;
                self.cell(&levels)
            });
            let cells = cells.collect();
            let name = series.map_or("", |axis| &self.axes[axis].levels[level].text);
            Series {
                name: name.to_owned(),
                cells,
            }
        });
        let series = curves.collect();
        Panel {
            name: named.collect::<Vec<_>>().join(", "),
            series,
        }
    }

    /// All combinations of levels of some axes.
    fn combinations(&self, axes: &[usize]) -> Vec<Vec<usize>> {
        axes.iter().fold(vec![Vec::new()], |before, axis| {
            let levels = 0..self.axes[*axis].levels.len();
            let extended = before.iter().flat_map(|combination| {
                levels
                    .clone()
                    .map(|level| [combination.as_slice(), &[level]].concat())
            });
            extended.collect()
        })
    }

    /// The two axes of a heat map, if the cells are a grid of two factors of numbers.
    pub(super) fn map(&self) -> Option<(usize, usize)> {
        let numeric = self.axes.iter().all(|axis| axis.numeric);
        let is_map = self.shape == Shape::Grid && self.axes.len() == 2 && numeric;
        is_map.then_some(match self.wanted.x {
            Some(0) => (0, 1),
            _ => (1, 0),
        })
    }
}

/// Which of `count` things to show if only so many can be: evenly spread, both ends among them.
pub(super) fn spread(count: usize, most: usize) -> Vec<usize> {
    if count <= most {
        return (0..count).collect();
    }
    (0..most)
        .map(|index| index * (count - 1) / (most - 1))
        .collect()
}

fn shape(axes: &[Axis], places: &[Vec<usize>], lookup: &BTreeMap<Vec<usize>, usize>) -> Shape {
    if axes.is_empty() {
        return Shape::Single;
    }
    let combinations = axes.iter().try_fold(1usize, |product, axis| {
        product.checked_mul(axis.levels.len())
    });
    if combinations == Some(lookup.len()) {
        return Shape::Grid;
    }
    let mut in_order: Vec<&Vec<usize>> = places.iter().collect();
    in_order.sort();
    let advance = in_order.windows(2).all(|pair| {
        pair[0]
            .iter()
            .zip(pair[1])
            .all(|(before, after)| before < after)
    });
    if advance {
        Shape::Row
    } else {
        Shape::Scattered
    }
}

impl Axis {
    fn new(manifest: &Manifest, factor: usize) -> Self {
        let about = &manifest.factors[factor];
        let mut seen = BTreeSet::new();
        let mut levels = Vec::new();
        for cell in &manifest.cells {
            let (Some(value), Some(text)) = (cell.values.get(factor), cell.texts.get(factor))
            else {
                continue;
            };
            if seen.insert(text.clone()) {
                levels.push((text.clone(), value.as_f64()));
            }
        }
        let numeric = levels.iter().all(|(_, number)| number.is_some());
        if numeric {
            levels.sort_by(|(_, a), (_, b)| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        }
        // Texts such as "600ms" have their unit; bare numbers have that of the factor.
        let bare = levels.iter().all(|(text, _)| text.parse::<f64>().is_ok());
        let label = match (bare, about.unit.as_str()) {
            (true, unit) if !unit.is_empty() => format!("{} ({unit})", about.label),
            _ => about.label.clone(),
        };
        let numbered = levels.into_iter().enumerate();
        let level = |(place, (text, number)): (usize, (String, Option<f64>))| Level {
            text,
            value: number.filter(|_| numeric).unwrap_or(place as f64),
        };
        Axis {
            factor,
            label,
            levels: numbered.map(level).collect(),
            numeric,
            scale: about.scale,
        }
    }

    /// What it is called before a level's text.
    pub(super) fn name(&self) -> &str {
        &self.label
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::fabricated::{bandwidth, latency, loss, planner, study};
    use crate::study::results::PlotAxes;

    #[test]
    fn numbers_go_along_and_words_make_curves() {
        let layout = Layout::new(&study("x", vec![planner(), loss()], 1).manifest);
        assert_eq!(layout.shape, Shape::Grid);
        let curves = layout.curves().unwrap();
        assert_eq!((curves.x, curves.series), (1, Some(0)));
        let names = |panel: &Panel| -> Vec<String> {
            panel
                .series
                .iter()
                .map(|series| series.name.clone())
                .collect()
        };
        assert_eq!(names(&curves.panels[0]), ["max-plus", "greedy", "priority"]);
        assert_eq!(curves.panels[0].series[2].cells, [10, 11, 12, 13, 14]);
        assert_eq!(layout.map(), None);
    }

    #[test]
    fn further_factors_make_further_plots() {
        let manifest = study("x", vec![latency(), loss(), planner()], 1).manifest;
        let curves = Layout::new(&manifest).curves().unwrap();
        let names: Vec<&str> = curves
            .panels
            .iter()
            .map(|panel| panel.name.as_str())
            .collect();
        assert_eq!(
            names,
            ["planner max-plus", "planner greedy", "planner priority"]
        );
        assert!(!curves.more);
    }

    #[test]
    fn a_study_says_what_goes_where() {
        let mut manifest = study("x", vec![latency(), loss(), planner()], 1).manifest;
        let mut laid = |x: Option<&str>, series: Option<&str>, facet: Option<&str>| {
            let [x, series, facet] = [x, series, facet].map(|name| name.map(str::to_owned));
            manifest.report = PlotAxes { x, series, facet };
            let curves = Layout::new(&manifest).curves().unwrap();
            let first = curves.panels[0].name.clone();
            (curves.x, curves.series, curves.panels.len(), first)
        };
        let planners = |x, series| (x, Some(series), 3, "planner max-plus".to_owned());
        assert_eq!(laid(None, None, None), planners(0, 1));
        assert_eq!(laid(Some("loss"), None, None), planners(1, 0));
        let by_latency = (1, Some(2), 5, "one-way latency 5ms".to_owned());
        assert_eq!(
            laid(Some("loss"), Some("planner"), Some("latency")),
            by_latency
        );
        assert_eq!(laid(None, None, Some("latency")), by_latency);
        // A factor that does not vary is on no plot.
        manifest = study("x", vec![planner(), loss()], 1).manifest;
        manifest.report.facet = Some("planner".to_owned());
        let curves = Layout::new(&manifest).curves().unwrap();
        assert_eq!((curves.x, curves.series, curves.panels.len()), (1, None, 3));
    }

    #[test]
    fn shapes_are_told_apart() {
        let mut manifest = study("x", vec![latency(), loss()], 1).manifest;
        assert_eq!(Layout::new(&manifest).map(), Some((1, 0)));
        manifest.cells = [0, 6, 12, 18, 24]
            .map(|cell| manifest.cells[cell].clone())
            .to_vec();
        let row = Layout::new(&manifest);
        assert_eq!(row.shape, Shape::Row);
        assert_eq!(
            row.curves().unwrap().panels[0].series[0].cells,
            [0, 1, 2, 3, 4]
        );
        manifest.cells.swap(0, 3);
        let texts = manifest.cells[0].texts.clone();
        manifest.cells[1].texts[1] = texts[1].clone();
        assert_eq!(Layout::new(&manifest).shape, Shape::Scattered);
        assert!(Layout::new(&manifest).curves().is_none());
        manifest.cells.truncate(1);
        assert_eq!(Layout::new(&manifest).shape, Shape::Single);
        let one = Layout::new(&study("x", vec![bandwidth()], 1).manifest);
        assert_eq!((one.shape, one.axes[0].scale), (Shape::Grid, Scale::Log));
    }

    #[test]
    fn a_choice_keeps_both_ends() {
        assert_eq!(spread(3, 7), [0, 1, 2]);
        assert_eq!(spread(20, 7), [0, 3, 6, 9, 12, 15, 19]);
    }
}
