//! Lists of rows: the neighbors of points, the points of cells, the points of clouds.

use std::sync::OnceLock;

/// For each of `len` outputs, a list of rows of an input with `n_rows` rows.
#[derive(Debug, Default)]
pub struct Lists {
    /// End of each list in `items`.
    ends: Vec<u32>,
    items: Vec<u32>,
    n_rows: usize,
    /// The outputs that use each row.
    transposed: OnceLock<Box<Transposed>>,
}

/// The outputs that use each row of an input.
#[derive(Debug)]
pub(super) struct Transposed {
    /// For each row the lists that contain it, ascending.
    pub lists: Lists,
    /// The index of the row in the items of the list, for each item of `lists`.
    pub places: Vec<u32>,
}

impl Lists {
    /// Lists of rows. Together they must have fewer than 2^32 items, all less than `n_rows`.
    pub fn new<I: IntoIterator<Item = u32>>(lists: impl IntoIterator<Item = I>, n_rows: usize) -> Self {
        let mut ends = Vec::new();
        let mut items = Vec::new();
        for list in lists {
            items.extend(list);
            ends.push(items.len() as u32);
        }
        assert!(u32::try_from(items.len()).is_ok(), "{} list items: places have 32 bits", items.len());
        assert!(items.iter().all(|row| (*row as usize) < n_rows), "list items are less than {n_rows}");
        Self { ends, items, n_rows, transposed: OnceLock::new() }
    }
    /// Lists of one row for each output.
    pub fn single(rows: impl IntoIterator<Item = u32>, n_rows: usize) -> Self {
        Self::new(rows.into_iter().map(|row| [row]), n_rows)
    }
    /// Lists of consecutive rows, with the given lengths.
    pub fn consecutive(lengths: &[usize]) -> Self {
        let mut start = 0;
        let ranges = lengths.iter().map(|length| {
            start += *length as u32;
            start - *length as u32..start
        });
        let ranges: Vec<_> = ranges.collect();
        Self::new(ranges, lengths.iter().sum())
    }
    /// Number of lists.
    pub fn len(&self) -> usize {
        self.ends.len()
    }
    /// Whether there are no lists.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }
    /// Number of rows of the input.
    pub fn n_rows(&self) -> usize {
        self.n_rows
    }
    /// Total length of all lists.
    pub fn n_items(&self) -> usize {
        self.items.len()
    }
    /// Range of a list in the items.
    #[inline(always)]
    pub(super) fn places(&self, list: usize) -> std::ops::Range<usize> {
        let start = if list == 0 { 0 } else { self.ends[list - 1] };
        start as usize..self.ends[list] as usize
    }
    /// The row at an index of the items.
    #[inline(always)]
    pub(super) fn item(&self, place: usize) -> u32 {
        self.items[place]
    }
    /// The rows of a list.
    #[inline(always)]
    pub fn get(&self, list: usize) -> &[u32] {
        &self.items[self.places(list)]
    }
    /// For each row the lists that contain it, ascending, and the indices of the row in the items.
    pub(super) fn transposed(&self) -> &Transposed {
        self.transposed.get_or_init(|| Box::new(self.transpose()))
    }
    /// For each row the lists that contain it, ascending.
    #[must_use]
    pub fn inverse(&self) -> Self {
        self.transpose().lists
    }
    fn transpose(&self) -> Transposed {
        let mut ends = vec![0_u32; self.n_rows];
        self.items.iter().for_each(|row| ends[*row as usize] += 1);
        let mut end = 0;
        for of_row in &mut ends {
            // The start of the row; it grows to the end while the row is filled.
            end += std::mem::replace(of_row, end);
        }
        let mut lists = vec![0; self.items.len()];
        let mut places = vec![0; self.items.len()];
        for list in 0..self.len() {
            for place in self.places(list) {
                let slot = &mut ends[self.items[place] as usize];
                (lists[*slot as usize], places[*slot as usize]) = (list as u32, place as u32);
                *slot += 1;
            }
        }
        let lists = Self { ends, items: lists, n_rows: self.len(), transposed: OnceLock::new() };
        Transposed { lists, places }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transposed_lists_contain_each_pair_once() {
        let lists = Lists::new([vec![2, 0], vec![], vec![2], vec![3, 2]], 5);
        let Transposed { lists: transposed, places } = lists.transposed();
        let all: Vec<&[u32]> = (0..5).map(|row| transposed.get(row)).collect();
        assert_eq!(all, [&[0][..], &[], &[0, 2, 3], &[3], &[]]);
        assert_eq!(places, &[1, 0, 2, 4, 3]);
        assert_eq!(transposed.n_rows(), 4);
    }
}
