//! Tests of the features that connect the crates with others: `serde` and `mint`.

mod mint_types;
mod serde_records;
