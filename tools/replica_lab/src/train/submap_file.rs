//! Submaps of points in a file: a data set may be larger than the memory.

use anyhow::Context;
use neighbors::SpatialIndex;
use segmentation::points::CellCloud;
use std::fs::File;
use std::io::Write;
use std::os::unix::fs::FileExt;
use std::path::Path;
use training::ClassifiedCells;

/// Bytes of a point: position, height and intensity as `f32`, color, and class.
const POINT_BYTES: usize = 24;

/// Submaps in a file without a name, which the system removes with the process. Points are in Morton order.
pub struct SubmapFile {
    file: File,
    submaps: Vec<Submap>,
    n_bytes: u64,
}

struct Submap {
    start: u64,
    n_points: usize,
    has_intensity: bool,
    has_color: bool,
}

impl SubmapFile {
    /// An empty file in a folder.
    pub fn create(folder: &Path) -> anyhow::Result<Self> {
        let file = tempfile::tempfile_in(folder).with_context(|| folder.display().to_string())?;
        Ok(Self { file, submaps: Vec::new(), n_bytes: 0 })
    }
    /// Number of submaps.
    pub fn len(&self) -> usize {
        self.submaps.len()
    }
    /// Appends a submap.
    pub fn push(&mut self, ClassifiedCells { cloud, truth }: &ClassifiedCells) -> anyhow::Result<()> {
        let order = SpatialIndex::new(&cloud.positions).order().to_vec();
        let mut bytes = Vec::with_capacity(order.len() * POINT_BYTES);
        for point in order.iter().map(|point| *point as usize) {
            let intensity = cloud.intensities.get(point).copied().unwrap_or(0.0);
            for number in cloud.positions[point].into_iter().chain([cloud.heights_m[point], intensity]) {
                bytes.extend(number.to_le_bytes());
            }
            bytes.extend(cloud.colors.get(point).map_or([0; 3], |color| color.map(|v| (255.0 * v).round() as u8)));
            bytes.push(truth[point]);
        }
        self.file.write_all(&bytes).context("the file of the training submaps")?;
        self.submaps.push(Submap {
            start: self.n_bytes,
            n_points: order.len(),
            has_intensity: !cloud.intensities.is_empty(),
            has_color: !cloud.colors.is_empty(),
        });
        self.n_bytes += bytes.len() as u64;
        Ok(())
    }
    /// Reads a submap.
    pub fn submap(&self, index: usize) -> std::io::Result<ClassifiedCells> {
        let Submap { start, n_points, has_intensity, has_color } = self.submaps[index];
        let mut bytes = vec![0; n_points * POINT_BYTES];
        self.file.read_exact_at(&mut bytes, start)?;
        let (points, _) = bytes.as_chunks::<POINT_BYTES>();
        let number = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        let color = |bytes: &[u8; POINT_BYTES]| [20, 21, 22].map(|i| f32::from(bytes[i]) / 255.0);
        let cloud = CellCloud {
            positions: points.iter().map(|b| [number(&b[0..]), number(&b[4..]), number(&b[8..])]).collect(),
            heights_m: points.iter().map(|b| number(&b[12..])).collect(),
            intensities: if has_intensity { points.iter().map(|b| number(&b[16..])).collect() } else { Vec::new() },
            colors: if has_color { points.iter().map(color).collect() } else { Vec::new() },
        };
        Ok(ClassifiedCells { cloud, truth: points.iter().map(|bytes| bytes[23]).collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use random::Random;

    fn cloud(seed: u64, n: usize) -> ClassifiedCells {
        let mut random = Random::new(seed);
        let cloud = CellCloud {
            positions: (0..n).map(|_| std::array::from_fn(|_| random.range(-20.0, 20.0))).collect(),
            heights_m: (0..n).map(|_| random.unit()).collect(),
            intensities: if seed == 1 { Vec::new() } else { (0..n).map(|_| 255.0 * random.unit()).collect() },
            colors: if seed == 2 { vec![[0.2, 0.4, 1.0]; n] } else { Vec::new() },
        };
        ClassifiedCells { cloud, truth: (0..n).map(|i| (i % 5) as u8).collect() }
    }

    #[test]
    fn submaps_are_read_as_they_were_written_in_any_order() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut file = SubmapFile::create(folder.path()).expect("created");
        let clouds: Vec<ClassifiedCells> = [(0, 50), (1, 1), (2, 300)].map(|(seed, n)| cloud(seed, n)).into();
        for cloud in &clouds {
            file.push(cloud).expect("written");
        }
        assert_eq!(file.len(), 3);
        for index in [2, 0, 1] {
            let ClassifiedCells { cloud, truth } = &clouds[index];
            let order = SpatialIndex::new(&cloud.positions).order().to_vec();
            let expected = ClassifiedCells {
                cloud: cloud.around([0.0; 3], &order),
                truth: order.iter().map(|point| truth[*point as usize]).collect(),
            };
            assert!(file.submap(index).expect("read") == expected, "submap {index}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).expect("listed").count(), 0, "the file has no name");
    }
}
