//! The regions of a map: which cells can be reached from which, without diagonal steps.

use super::{Cell, GridMap};

/// No region: a wall.
const NONE: u32 = u32::MAX;

/// Each passable cell belongs to one region. They are numbered from 0 in order of their first
/// cells.
pub(super) struct Regions {
    of_cell: Vec<u32>,
    sizes: Vec<usize>,
}

impl Regions {
    pub(super) fn of(map: &GridMap) -> Regions {
        let mut of_cell = vec![NONE; map.cells()];
        let mut sizes = Vec::new();
        let mut stack = Vec::new();
        for first in 0..map.cells() {
            if of_cell[first] != NONE || !map.is_passable(map.cell(first)) {
                continue;
            }
            // There are at most 2^22 cells, and no more regions.
            let region = sizes.len() as u32;
            let mut size = 0;
            of_cell[first] = region;
            stack.push(map.cell(first));
            while let Some(cell) = stack.pop() {
                size += 1;
                for beside in map.beside(cell) {
                    let at = map.index(beside).expect("what is beside is in the map");
                    if of_cell[at] == NONE {
                        of_cell[at] = region;
                        stack.push(beside);
                    }
                }
            }
            sizes.push(size);
        }
        Regions { of_cell, sizes }
    }

    /// The region of a passable cell of this map.
    pub(super) fn region(&self, map: &GridMap, cell: Cell) -> Option<u32> {
        let region = self.of_cell[map.index(cell)?];
        (region != NONE).then_some(region)
    }

    pub(super) fn size(&self, region: u32) -> usize {
        self.sizes[region as usize]
    }

    /// The region with most cells, of equal ones the first; `None` if all is wall.
    pub(super) fn largest(&self) -> Option<u32> {
        let largest = self.sizes.iter().copied().max()?;
        let region = self.sizes.iter().position(|size| *size == largest)?;
        Some(region as u32)
    }

    /// The cells of a region, as they stand in the file.
    pub(super) fn cells(&self, map: &GridMap, region: u32) -> Vec<Cell> {
        let all = self.of_cell.iter().enumerate();
        all.filter(|(_, of)| **of == region)
            .map(|(at, _)| map.cell(at))
            .collect()
    }
}
