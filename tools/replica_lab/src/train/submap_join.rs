//! Joins the submaps of a recording with their columns by the sequence number.

use super::camera_columns::{CameraColumns, CameraNeeds};
use super::sources::Labeled;
use anyhow::ensure;
use messages::{SpectraHeader, SpectraView, SubmapHeader, SubmapPoint};
use std::collections::BTreeMap;

/// Largest number of submaps that wait for columns: `colorize` holds a submap until the images after it have arrived.
const MOST_WAITING: usize = 8;

/// A submap with the class id of each point and the columns of the cameras.
pub struct LabeledSubmap {
    pub header: SubmapHeader,
    pub points: Vec<SubmapPoint>,
    pub classes: Vec<u8>,
    pub camera: CameraColumns,
}

impl LabeledSubmap {
    pub fn labeled(&self) -> Labeled<'_> {
        Labeled { input: self.camera.input(&self.header, &self.points), classes: &self.classes }
    }
}

/// Parts of a submap that have been read.
#[derive(Default)]
pub struct Parts {
    pub submap: Option<(SubmapHeader, Vec<SubmapPoint>)>,
    pub classes: Option<Vec<u8>>,
    pub camera: CameraColumns,
}

impl Parts {
    fn is_complete(&self, needs: &CameraNeeds) -> bool {
        self.submap.is_some()
            && self.classes.is_some()
            && (needs.color.is_none() || self.camera.colors.is_some())
            && (needs.spectra().is_none() || self.camera.spectra.is_some())
    }
    /// `None` without submap or classes. Colors and spectra that were lost in a live run are unknown, as for `infer`.
    fn finish(self, seq: u64) -> anyhow::Result<Option<LabeledSubmap>> {
        let (Some((header, points)), Some(classes)) = (self.submap, self.classes) else { return Ok(None) };
        let n_points = points.len();
        let lengths = [
            ("classes", Some(classes.len())),
            ("colors", self.camera.colors.as_ref().map(Vec::len)),
            ("points with an index of a spectrum", self.camera.spectra.as_ref().map(|(of, _)| of.n_points as usize)),
        ];
        for (what, n) in lengths {
            let n = n.unwrap_or(n_points);
            ensure!(n == n_points, "submap {seq} has {n_points} points and {n} {what}");
        }
        let is_valid = |(header, rows): &(Box<SpectraHeader>, Vec<u32>)| SpectraView::new(header, rows).is_some();
        ensure!(
            self.camera.spectra.as_ref().is_none_or(is_valid),
            "submap {seq}: the number of rows of its spectra does not fit their header"
        );
        Ok(Some(LabeledSubmap { header, points, classes, camera: self.camera }))
    }
}

/// Submaps that are not complete yet.
pub struct SubmapJoin {
    needs: CameraNeeds,
    waiting: BTreeMap<u64, Parts>,
    /// Sequence numbers below this one are done.
    begin: u64,
}

impl SubmapJoin {
    pub fn new(needs: CameraNeeds) -> Self {
        Self { needs, waiting: BTreeMap::new(), begin: 0 }
    }
    pub fn needs(&self) -> &CameraNeeds {
        &self.needs
    }
    /// The parts of a submap; `None` if it is done.
    pub fn parts(&mut self, seq: u64) -> Option<&mut Parts> {
        (seq >= self.begin).then(|| self.waiting.entry(seq).or_default())
    }
    /// The next submap in order; `None` until more has been read. Columns arrive in the order of their submaps: parts that an
    /// earlier submap lacks when a later one is complete, or at the end, were lost.
    pub fn next(&mut self, at_end: bool) -> anyhow::Result<Option<LabeledSubmap>> {
        while let Some((&seq, _)) = self.waiting.first_key_value() {
            let is_ready = at_end
                || self.waiting.len() > MOST_WAITING
                || self.waiting.values().any(|parts| parts.is_complete(&self.needs));
            if !is_ready {
                break;
            }
            let Some(parts) = self.waiting.remove(&seq) else { break };
            self.begin = seq + 1;
            if let Some(submap) = parts.finish(seq)? {
                return Ok(Some(submap));
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{ColorRow, UNSEEN};

    fn join() -> SubmapJoin {
        SubmapJoin::new(CameraNeeds { color: Some("red".to_owned()), bands: Vec::new() })
    }

    fn add_submap(join: &mut SubmapJoin, seq: u64) {
        let parts = join.parts(seq).expect("is not done");
        parts.submap = Some((SubmapHeader::default(), vec![SubmapPoint::default(); 3]));
        parts.classes = Some(vec![seq as u8; 3]);
    }

    fn add_colors(join: &mut SubmapJoin, seq: u64, n: usize) {
        let color = ColorRow { r: seq as u8, g: 0, b: 0, camera: 0 };
        join.parts(seq).expect("is not done").camera.colors = Some(vec![color; n]);
    }

    /// Class and red of the first point of the next submap; [`UNSEEN`] for red without colors.
    fn next(join: &mut SubmapJoin, at_end: bool) -> Option<[u8; 2]> {
        let submap = join.next(at_end).expect("valid")?;
        Some([submap.classes[0], submap.camera.colors.map_or(UNSEEN, |colors| colors[0].r)])
    }

    #[test]
    fn columns_that_come_after_the_next_submap_or_before_their_own_are_joined() {
        let mut join = join();
        add_submap(&mut join, 1);
        add_submap(&mut join, 2);
        assert_eq!(next(&mut join, false), None);
        add_colors(&mut join, 1, 3);
        assert_eq!((next(&mut join, false), next(&mut join, false)), (Some([1, 1]), None));
        add_colors(&mut join, 2, 3);
        add_colors(&mut join, 3, 3);
        assert_eq!((next(&mut join, false), next(&mut join, false)), (Some([2, 2]), None));
        add_submap(&mut join, 3);
        assert_eq!((next(&mut join, false), next(&mut join, true)), (Some([3, 3]), None));
    }

    #[test]
    fn lost_colors_are_unknown_and_submaps_without_classes_are_skipped() {
        let mut join = join();
        (1..4).for_each(|seq| add_submap(&mut join, seq));
        join.parts(2).expect("is not done").classes = None;
        add_colors(&mut join, 3, 3);
        assert_eq!([next(&mut join, false), next(&mut join, false)], [Some([1, UNSEEN]), Some([3, 3])]);
        assert!(join.parts(1).is_none(), "a column that arrives too late");
        add_submap(&mut join, 4);
        assert_eq!([next(&mut join, false), next(&mut join, true)], [None, Some([4, UNSEEN])]);
        (5..14).for_each(|seq| add_submap(&mut join, seq));
        assert_eq!(next(&mut join, false), Some([5, UNSEEN]), "a topic that has ended does not fill the memory");
    }

    #[test]
    fn column_of_another_length_is_refused() {
        let mut join = join();
        add_submap(&mut join, 7);
        add_colors(&mut join, 7, 2);
        let error = join.next(false).err().expect("is refused").to_string();
        assert_eq!(error, "submap 7 has 3 points and 2 colors");
    }
}
