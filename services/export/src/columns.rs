//! The columns that export joins to each submap: the published columns of the table, and further classes.

use crate::Settings;
use delivery::{CloudColumn, CloudFields, ReceivedColumn};
use messages::columns::Column;
use messages::{ClassTopic, Message, SpectraTopic};
use stage::{ColumnPort, Context, JoinedSubmap, Mode, Port, StepError, SubmapJoin};

/// The columns of a run.
pub(crate) struct JoinedColumns {
    /// All columns of the table.
    columns: Vec<JoinedColumn>,
    /// Topics of further segmenters.
    further: Vec<ColumnPort>,
}

/// A column of the table in this run.
struct JoinedColumn {
    column: ColumnPort,
    /// Whether each submap waits for it.
    is_expected: bool,
}

impl JoinedColumns {
    /// The columns that are expected in this run: fixed before its start, so that files do not depend on timing.
    pub(crate) fn new(table: Vec<ColumnPort>, settings: &Settings, context: &Context) -> Self {
        let is_connected = |topic: &str| context.connected.iter().any(|connected| connected == topic);
        let is_wanted = |topic: &str| topic != SpectraTopic::TOPIC || settings.spectra;
        let joined = |column: ColumnPort| {
            let topic = column.port.topic();
            JoinedColumn { column, is_expected: is_connected(topic) && is_wanted(topic) }
        };
        let class = by_topic(&table, ClassTopic::TOPIC);
        let further =
            class.iter().flat_map(|column| further_ports(settings).into_iter().map(|port| ColumnPort { column, port }));
        Self { further: further.collect(), columns: table.into_iter().map(joined).collect() }
    }

    /// Columns that each submap should have.
    pub(crate) fn n_expected(&self) -> usize {
        self.columns.iter().filter(|column| column.is_expected).count() + self.further.len()
    }

    /// Whether spectra are written.
    pub(crate) fn has_spectra(&self) -> bool {
        self.columns.iter().any(|column| column.is_expected && column.column.port.topic() == SpectraTopic::TOPIC)
    }

    /// The join of submaps with these columns.
    pub(crate) fn join(&self, mode: Mode) -> SubmapJoin {
        let join = SubmapJoin::new(mode);
        let join =
            self.columns.iter().fold(join, |join, joined| join.column_of(&joined.column.port, joined.is_expected));
        self.further.iter().fold(join, |join, further| join.column_of(&further.port, true))
    }

    /// The fields of the clouds.
    pub(crate) fn fields(&self, settings: &Settings) -> CloudFields<'static> {
        let coordinates = settings.coordinates.kind();
        CloudFields { coordinates, columns: self.in_clouds().map(|(_, column)| column).collect() }
    }

    /// The columns of a submap that have arrived, without spectra.
    pub(crate) fn received<'a>(&self, joined: &'a JoinedSubmap) -> Result<Vec<ReceivedColumn<'a>>, StepError> {
        let mut received = Vec::new();
        for (port, column) in self.in_clouds() {
            received.extend(joined.row_bytes(&port)?.map(|rows| ReceivedColumn { column, rows }));
        }
        Ok(received)
    }

    /// Ports and columns of the expected fields of clouds.
    fn in_clouds(&self) -> impl Iterator<Item = (Port, CloudColumn<'static>)> {
        let columns =
            self.columns.iter().filter(|joined| joined.is_expected && !joined.column.column.fields.is_empty());
        let columns = columns.map(|joined| (joined.column.port, CloudColumn::new(joined.column.column)));
        let renamed = |further: &ColumnPort| {
            let renamed = Some(further.port.topic());
            (further.port, CloudColumn { column: further.column, renamed })
        };
        columns.chain(self.further.iter().map(renamed))
    }
}

/// The column of the table on a topic.
pub(crate) fn by_topic(table: &[ColumnPort], topic: &str) -> Option<&'static Column> {
    table.iter().find(|column| column.port.topic() == topic).map(|column| column.column)
}

/// The topics of further segmenters.
pub(crate) fn further_ports(settings: &Settings) -> Vec<Port> {
    settings.further_classes.iter().map(|topic| Port::of::<ClassTopic>().named(topic)).collect()
}
