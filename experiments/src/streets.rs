//! Tables 6.6, 6.8, 6.9, 6.10 and 6.12 on sweeps of simulated towns, with a small U-Net on range images instead of `KPConv`.

mod ideal_colors;
mod iou_table;
mod street_data;
mod sweep_images;
pub mod transfer;

use crate::loss_table::mean_and_deviation;
use iou_table::{ALL, Column, print_iou_table};
use messages::ClassId;
use street_data::StreetData;
use training::Loss;

/// All classes except ground.
const M2: &[ClassId] = ALL.split_at(10).0;
/// All classes except ground and buildings.
const M3: &[ClassId] = ALL.split_at(9).0;

const POWER_2: Loss = Loss::PowerJaccard { power: 2.0 };
pub const CE_AND_POWER_2: Loss = Loss::CrossEntropyPowerJaccard { power: 2.0 };

/// Prints tables 6.9 and 6.10.
pub fn hierarchy(n_seeds: u64) -> anyhow::Result<()> {
    let data = StreetData::urban(false)?;
    let column = |name, loss, hierarchy| -> anyhow::Result<Column<'_>> {
        Ok((name, &ALL, data.confusions(&ALL, false, (loss, hierarchy), n_seeds)?))
    };
    let columns = [
        column("CE", &Loss::CrossEntropy, false)?,
        column("CE + Jac. 2", &CE_AND_POWER_2, false)?,
        column("Jac. 2", &POWER_2, false)?,
        column("hierarchical Jac. 2", &POWER_2, true)?,
    ];
    print_iou_table(&columns, &ALL);
    let percents =
        |column: &Column<'_>| column.2.iter().map(|c| 100.0 * c.mean_iou().unwrap_or(0.0)).collect::<Vec<_>>();
    let gains: Vec<f64> =
        percents(&columns[3]).iter().zip(percents(&columns[2])).map(|(with, flat)| with - flat).collect();
    let (mean, deviation) = mean_and_deviation(&gains);
    let error = deviation / (gains.len() as f64 - 1.0).sqrt();
    println!("\nGain of the hierarchy by seed: {gains:.1?}, mean {mean:.1} with a standard error of {error:.1}");
    Ok(())
}

/// Prints table 6.8.
pub fn specialized(n_seeds: u64) -> anyhow::Result<()> {
    let data = StreetData::urban(false)?;
    let column = |name, classes| -> anyhow::Result<Column<'_>> {
        Ok((name, classes, data.confusions(classes, false, (&CE_AND_POWER_2, false), n_seeds)?))
    };
    print_iou_table(&[column("M1", &ALL)?, column("M2", M2)?, column("M3", M3)?], M3);
    Ok(())
}

/// Prints table 6.12, column P3, with cross-entropy added to the thesis' Jac. 2: alone it learns too slowly for these short trainings.
pub fn color(n_seeds: u64) -> anyhow::Result<()> {
    let data = StreetData::urban(true)?;
    let column = |name, with_color| -> anyhow::Result<Column<'_>> {
        Ok((name, &ALL, data.confusions(&ALL, with_color, (&CE_AND_POWER_2, false), n_seeds)?))
    };
    print_iou_table(&[column("geometry", false)?, column("geometry and RGB", true)?], &ALL);
    Ok(())
}
