//! Which rocks lie near a place: rocks sorted by the cells of a grid.

use std::ops::Range;

use nalgebra::Point2;

use crate::rocks::Rock;

/// The most cells along a side.
const MAX_CELLS: f64 = 512.0;

/// Where in a list of rocks each cell begins.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Grid {
    half_m: f64,
    cell_m: f64,
    cells: usize,
    /// For each cell its first rock, and after the last cell the number of rocks.
    first: Vec<u32>,
}

impl Grid {
    /// Sorts rocks by cells: rows from south to north, in them from west to east.
    pub(super) fn sort(side_m: f64, rocks: &mut [Rock]) -> Grid {
        // Two rocks in a cell, about.
        let cells = libm::ceil(libm::sqrt(0.5 * rocks.len() as f64)).clamp(1.0, MAX_CELLS) as usize;
        let mut grid = Grid {
            half_m: 0.5 * side_m,
            cell_m: side_m / cells as f64,
            cells,
            first: vec![0; cells * cells + 1],
        };
        rocks.sort_by_cached_key(|rock| grid.cell_of(rock.position_m));
        for rock in rocks.iter() {
            let cell = grid.cell_of(rock.position_m);
            grid.first[cell + 1] += 1;
        }
        for cell in 0..cells * cells {
            grid.first[cell + 1] += grid.first[cell];
        }
        grid
    }

    fn cell_of(&self, position_m: Point2<f64>) -> usize {
        self.index(position_m.y) * self.cells + self.index(position_m.x)
    }

    /// The row or column of a coordinate; the nearest one for what is outside.
    fn index(&self, coordinate_m: f64) -> usize {
        (((coordinate_m + self.half_m) / self.cell_m) as usize).min(self.cells - 1)
    }

    /// Ranges of rocks, ascending, in which are all that lie within a square around a place.
    pub(super) fn ranges(
        &self,
        center_m: Point2<f64>,
        radius_m: f64,
    ) -> impl Iterator<Item = Range<usize>> {
        let from = Point2::new(
            self.index(center_m.x - radius_m),
            self.index(center_m.y - radius_m),
        );
        let to = Point2::new(
            self.index(center_m.x + radius_m),
            self.index(center_m.y + radius_m),
        );
        (from.y..=to.y).map(move |row| {
            let row = row * self.cells;
            self.first[row + from.x] as usize..self.first[row + to.x + 1] as usize
        })
    }
}
