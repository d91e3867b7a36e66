//! Publishing for both recorded drives and live sensors.

use crate::{Settings, sweep};
use acquisition::doubts::{DoubtLimits, Doubts};
use acquisition::recorded::{CameraFileError, News, image_into, mosaic_into};
use acquisition::rows::{StampedHeader, gnss_row, sweep_header};
use drive::manifest::{CameraEntry, MosaicEntry};
use drive::{Frame, SweepInfo};
use lidar::nmea::Fix;
use messages::{GnssRow, GnssTopic, ImageHeader, ImageTopic, MosaicHeader, MosaicTopic, SweepPoint, SweepTopic};
use stage::{Loan, Outputs, StepError};

/// Publishes a color image. A damaged file is skipped; its error is returned.
pub(crate) fn publish_image(
    frame: &Frame,
    entry: &CameraEntry,
    outputs: &mut Outputs,
) -> Result<Option<CameraFileError>, StepError> {
    let (width, height) = entry.model.size();
    let n_bytes = width as usize * height as usize * 3;
    let mut loan: Loan<ImageTopic> = outputs.loan(n_bytes)?;
    let pixels = loan.grow_unset(n_bytes)?;
    let decoded = stage::catch_panic(|| image_into(&frame.path, entry, pixels))
        .unwrap_or_else(|text| Err(CameraFileError::decoder_panicked(&frame.path, text)));
    if let Err(error) = decoded {
        return Ok(Some(error));
    }
    let camera = frame.camera as u32;
    let exposure_nanos = entry.exposure_nanos;
    *loan.header_mut() = ImageHeader { camera, width, height, channels: 3, exposure_nanos };
    outputs.publish(loan, frame.stamp.0)?;
    Ok(None)
}

/// Publishes a raw mosaic. A damaged file is skipped; its error is returned.
pub(crate) fn publish_mosaic(
    frame: &Frame,
    entry: &MosaicEntry,
    outputs: &mut Outputs,
) -> Result<Option<CameraFileError>, StepError> {
    let (width, height) = entry.model.size();
    let n_samples = width as usize * height as usize;
    let mut loan: Loan<MosaicTopic> = outputs.loan(n_samples)?;
    if let Err(error) = mosaic_into(&frame.path, entry, loan.grow_unset(n_samples)?) {
        return Ok(Some(error));
    }
    let MosaicEntry { bit_depth, exposure_nanos, .. } = *entry;
    *loan.header_mut() = MosaicHeader { camera: frame.camera as u32, width, height, bit_depth, exposure_nanos };
    outputs.publish(loan, frame.stamp.0)?;
    Ok(None)
}

/// Publishes a sweep whose points are in the loan.
pub(crate) fn publish_sweep(
    mut loan: Loan<SweepTopic>,
    sweep: &SweepInfo,
    n_rings: usize,
    outputs: &mut Outputs,
) -> Result<(), StepError> {
    *loan.header_mut() = sweep_header(sweep, n_rings);
    outputs.publish(loan, sweep.stamp.0)
}

/// Publishes the points of a secondary LiDAR that `read` passes on, if there are any.
pub(crate) fn publish_secondary(
    read: impl FnOnce(&mut dyn FnMut(&[SweepPoint])) -> Result<Option<StampedHeader>, StepError>,
    outputs: &mut Outputs,
) -> Result<(), StepError> {
    let mut loan = sweep::loan(outputs)?;
    let Some(StampedHeader { header, stamp }) = sweep::fill(&mut loan, read)? else { return Ok(()) };
    *loan.header_mut() = header;
    outputs.publish(loan, stamp)
}

/// Publishes the fixes that have a height. Returns their number.
pub(crate) fn publish_fixes(fixes: &[Fix], outputs: &mut Outputs) -> Result<u64, StepError> {
    let rows: Vec<GnssRow> = fixes.iter().filter_map(gnss_row).collect();
    let n_without_height = fixes.len() - rows.len();
    if n_without_height > 0 {
        outputs.count("gnss_without_height", n_without_height as u64);
    }
    outputs.publish_rows::<GnssTopic>(&rows, |row| row.stamp)?;
    Ok(rows.len() as u64)
}

/// Adds news to the run summary.
pub(crate) fn report(news: News, outputs: &mut Outputs) {
    outputs.count_all(news.counts);
    news.notes.into_iter().for_each(|text| outputs.note(text));
}

/// An empty collection of doubts, with the limits of the settings.
pub(crate) fn no_doubts(settings: &Settings) -> Doubts {
    let Settings { max_damaged_share, max_foreign_share, max_outside_share, max_unlocked_share, min_fix_share, .. } =
        *settings;
    Doubts::new(DoubtLimits {
        max_damaged_share,
        max_foreign_share,
        max_outside_share,
        max_unlocked_share,
        min_fix_share,
    })
}

/// Reports doubts at the end of the run.
pub(crate) fn report_doubts(doubts: Doubts, outputs: &mut Outputs) {
    for doubt in doubts.found() {
        outputs.report_doubt(&doubt);
    }
}
