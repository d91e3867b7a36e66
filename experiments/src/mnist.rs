//! Tables 5.1 and 5.2: a U-Net of three levels on MNIST digits. A pixel above half of the full value belongs to the digit. In the
//! multiclass table its class is the digit; background is a class, too.
//!
//! Only the 10 000 test images of MNIST are used: the first ones for training, 200 or 500 others for validation, and 500 others for
//! testing.

use crate::loss_table::{Task, losses, settings, weights};
use anyhow::Context;
use flate2::read::GzDecoder;
use random::Random;
use segmentation::engine::{Border, Planes};
use segmentation::network::NetworkSpec;
use std::io::{Error, ErrorKind, Read};
use std::path::Path;
use training::Hierarchy;
use training::{Dataset, Example};

const SIDE: usize = 28;

/// A data set of images of digits.
struct Digits {
    images: Vec<Vec<u8>>,
    digits: Vec<u8>,
    is_binary: bool,
}

impl Dataset for Digits {
    fn len(&self) -> usize {
        self.images.len()
    }
    fn example(&self, index: usize, _: Option<&mut Random>) -> Example {
        let mut input = Planes::zeros(1, SIDE, SIDE);
        for (y, row) in self.images[index].chunks_exact(SIDE).enumerate() {
            for (pixel, value) in input.row_mut(0, y).iter_mut().zip(row) {
                pixel[0] = f32::from(*value) / 255.0;
            }
        }
        let class = if self.is_binary { 1 } else { 1 + self.digits[index] };
        let truth = self.images[index].iter().map(|&value| if value > 127 { class } else { 0 }).collect();
        Example { input, truth }
    }
}

/// Unzips a file and removes its header.
fn unzipped(path: &Path, header: usize) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    GzDecoder::new(std::fs::File::open(path)?).read_to_end(&mut bytes)?;
    bytes
        .get(header..)
        .map(<[u8]>::to_vec)
        .ok_or_else(|| Error::new(ErrorKind::UnexpectedEof, "shorter than its header"))
}

fn digits(folder: &Path, range: std::ops::Range<usize>, is_binary: bool) -> Result<Digits, Error> {
    let pixels = unzipped(&folder.join("t10k-images-idx3-ubyte.gz"), 16)?;
    let labels = unzipped(&folder.join("t10k-labels-idx1-ubyte.gz"), 8)?;
    let images = pixels.chunks_exact(SIDE * SIDE).skip(range.start).take(range.len()).map(<[u8]>::to_vec).collect();
    Ok(Digits { images, digits: labels[range].to_vec(), is_binary })
}

/// Prints table 5.1 (2 and 4 filters, batch of 1) or table 5.2 (8 filters, batch of 10).
pub fn run(is_binary: bool, n_seeds: u64) -> anyhow::Result<()> {
    let folder =
        real_data::find("mnist").context("mnist/ is not in the folder of real data\nhint: see tests/real_data")?;
    let (n_images, n_validation, n_classes) = if is_binary { (400, 500, 2) } else { (1000, 200, 11) };
    let train = digits(&folder, 0..n_images, is_binary)?;
    let validation = digits(&folder, 9500 - n_validation..9500, is_binary)?;
    let test = digits(&folder, 9500..10_000, is_binary)?;
    let (filter_counts, settings): (&[usize], _) =
        if is_binary { (&[2, 4], settings(5, 1, 1e-3)) } else { (&[8], settings(10, 10, 3e-3)) };
    let names: &[&str] = if is_binary {
        &["background", "digit"]
    } else {
        &["background", "0", "1", "2", "3", "4", "5", "6", "7", "8", "9"]
    };
    for &filters in filter_counts {
        println!("\n{filters} filters\n");
        let widths = vec![filters, 2 * filters, 4 * filters];
        let task = Task {
            train: &train,
            validation: &validation,
            test: &test,
            spec: NetworkSpec::Unet { inputs: 1, outputs: n_classes, widths, head: None },
            shape: (n_classes, 1),
            border: Border::Zero,
            tree: Hierarchy::new(vec![0; n_classes]),
            settings: settings.clone(),
        };
        task.table_of_losses(&losses(weights(&train, n_classes), &[1.25, 1.5, 1.75, 2.0]), names, n_seeds)?;
    }
    Ok(())
}
