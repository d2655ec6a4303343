//! Recordings in any format, and reports.

use clap::ValueEnum;
use measurement::SensorProfile;
use recordings::ReadOptions;
use recordings::file_format::{RecordedFormat, RecordedInput};
use recordings::recorded_file::FrameReader;
use recordings::sample_stream::{KeptInMemory, Reading, SampleStream};
use recordings::{ColumnSelection, count_table};
use reports::export::{AxisChoice, ExportFormat, export};
use reports::saved_report::SavedReport;
use std::io::Write;

const KEPT: KeptInMemory = KeptInMemory { rows: 1 << 12, rows_with_losses: 1 << 14, most_lost: 0.25 };

/// Reads these bytes as a file, in the way of every command.
pub(crate) fn recording(bytes: &[u8]) {
    let mut file = tempfile::NamedTempFile::new().expect("a file");
    file.write_all(bytes).expect("room");
    let Ok(input) = RecordedInput::open(file.path()) else { return };
    let _any = input.inspect(None, &ColumnSelection::default());
    let _any = (input.sensors(), input.contents());
    let range = adis16405_driver::GyroRange::Dps300;
    match input.format() {
        RecordedFormat::FrameLog | RecordedFormat::SpiExport => {
            let Ok(Some(mut frames)) = FrameReader::open(input.bytes()) else { return };
            while let Ok(Some(_)) = frames.next() {}
        }
        RecordedFormat::CountTable => {
            let _any = count_table::read(input.bytes(), range);
            if let Ok(stream) = SampleStream::counts(input, range, Reading::new(None, KEPT)) {
                read_to_its_end(stream);
            }
        }
        _ => {
            let options =
                ReadOptions { sensor: SensorProfile::generic(), selection: ColumnSelection::default(), topic: None };
            if let Ok(stream) = SampleStream::any_sensor(input, options, Reading::new(None, KEPT)) {
                read_to_its_end(stream);
            }
        }
    }
}

fn read_to_its_end(mut stream: SampleStream) {
    let _any = stream.read(drop);
}

/// A text that is accepted as a report can be exported or is refused, in every format.
pub(crate) fn report(bytes: &[u8]) {
    let Ok(text) = core::str::from_utf8(bytes) else { return };
    let Ok(report) = SavedReport::from_json(text) else { return };
    for format in ExportFormat::value_variants() {
        let _any = export(&report, *format, AxisChoice::default());
    }
}
