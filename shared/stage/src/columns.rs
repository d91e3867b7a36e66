//! The columns of submaps as ports, for stages that treat all columns alike.

use crate::Port;
use messages::Message;
use messages::columns::{Column, ColumnVisitor, visit_columns};

/// A column and its port.
#[derive(Clone, Copy, Debug)]
pub struct ColumnPort {
    /// Its entry in the table.
    pub column: &'static Column,
    /// Its topic.
    pub port: Port,
}

impl ColumnPort {
    /// The column on the topic of `T`.
    pub fn new<T: Message>(column: &'static Column) -> Self {
        Self { column, port: Port::of::<T>() }
    }

    /// The columns of [`COLUMNS`](messages::columns::COLUMNS) that have their own topics, in the order of the table.
    pub fn all() -> Vec<Self> {
        struct Ports(Vec<ColumnPort>);
        impl ColumnVisitor for Ports {
            fn visit<T: Message>(&mut self, column: &'static Column) {
                self.0.push(ColumnPort::new::<T>(column));
            }
        }
        let mut ports = Ports(Vec::new());
        visit_columns(&mut ports);
        ports.0
    }
}

/// The table of a stage that joins all columns. It is a type parameter of the stage, so that a test can add columns.
pub trait ColumnTable: 'static {
    /// The columns that have their own topics.
    fn ports() -> Vec<ColumnPort>;
}

/// [`COLUMNS`](messages::columns::COLUMNS), the table of the pipeline.
pub struct AllColumns;

impl ColumnTable for AllColumns {
    fn ports() -> Vec<ColumnPort> {
        ColumnPort::all()
    }
}
