//! The `.tens` language for structures and environments, with its `.param` and
//! `.links` files.

mod expression;
mod links;
mod param;
mod parser;
mod scanner;

pub(crate) use expression::{Reader, Reported, Scope};
pub(crate) use links::read_row;
pub(crate) use param::Parameters;
pub(crate) use parser::{parse, transform};
pub(crate) use scanner::Token;
