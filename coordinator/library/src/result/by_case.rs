//! Storage on a PostgreSQL server: one row per case, and one row per pass for its series.

use super::columns::{LEVEL_COLUMNS, of_report};
use crate::LibraryError;
use crate::engine::{Connection, Value, sql};
use crate::report::Report;
use tracktwin_experiment::PassFeatures;
use tracktwin_protocol::CaseReport;

/// Number of cases in one statement. It is small, so that the data, which client and server copy several
/// times, stay in the processor's cache.
const CASES_A_STATEMENT: usize = 64;

/// Inserts rows of cases and passes from lists. $1 to $7 and $15 have one value for the report, $8 to $11
/// one value per case. Levels ($12), series ($13) and contact-loss shares ($14) of all passes are
/// concatenated.
const INSERT: &str = "
    with given as (
        select sobol_index, duration_s, parameter_hash, checksum, cast(place as integer) as place
        from unnest($8::bigint[], $9::double precision[], $10::text[], $11::text[]) with ordinality
            as of (sobol_index, duration_s, parameter_hash, checksum, place)),
    size as (
        select cardinality($7::double precision[]) as passes,
            cardinality($12::double precision[]) / cardinality($8) as levels,
            length($13::bytea) / (cardinality($8) * cardinality($7)) as bytes),
    stored as (
        insert into case_result (campaign_id, worker, code_version, model_hash, experiment_hash,
            finished_at, speeds_km_h, sobol_index, duration_s, parameter_hash, checksum, levels_dB,
            contact_loss_shares, flagged)
        select $1, $2, $3, $4, $5, $6, $7, sobol_index, duration_s, parameter_hash, checksum,
            ($12)[levels * (place - 1) + 1:levels * place],
            ($14::double precision[])[passes * (place - 1) + 1:passes * place], $15
        from given, size
        returning id, sobol_index)
    insert into case_series (result_id, speed_km_h, log_power)
    select id, ($7)[pass],
        substring($13 from bytes * (passes * (place - 1) + pass - 1) + 1 for bytes)
    from stored join given using (sobol_index), size, generate_series(1, passes) as pass";

/// Inserts results. Because of network delays, one statement inserts many cases. Levels and series are
/// concatenated; each row takes its part of them.
pub(super) async fn insert(
    connection: &mut Connection,
    report: &Report,
    finished: &[(&CaseReport, &[PassFeatures])],
    flagged: Option<String>,
) -> Result<(), LibraryError> {
    for cases in finished.chunks(CASES_A_STATEMENT) {
        let passes = || cases.iter().flat_map(|(_, passes)| passes.iter());
        let features = || passes().map(|pass| &pass.features);
        let indices: Vec<i64> = cases.iter().map(|(case, _)| case.index.into()).collect();
        let hashes = cases.iter().map(|(case, _)| case.parameter_hash.clone()).collect();
        let checksums = cases.iter().map(|(case, _)| case.checksum.clone()).collect();
        let insert = of_report(sql(INSERT), report)
            .bind(Value::Reals(report.speeds_km_h.clone()))
            .bind(indices)
            .bind(Value::Reals(cases.iter().map(|(case, _)| case.duration_s).collect()))
            .bind(Value::Texts(hashes))
            .bind(Value::Texts(checksums))
            .bind(Value::Reals(features().flat_map(|it| &it.band_levels_db).copied().collect()))
            .bind(Value::series(features().map(|it| &it.log_power[..])))
            .bind(Value::OptionalReals(passes().map(|it| it.contact_loss_share).collect()))
            .bind(flagged.clone());
        connection.execute(insert).await?;
    }
    Ok(())
}

/// Prevents other transactions from writing results of these cases until this transaction ends. Returns the
/// number of these cases that exist.
pub(crate) async fn lock(
    connection: &mut Connection,
    campaigns: Vec<String>,
    indices: Vec<i64>,
) -> Result<u64, LibraryError> {
    let lock = "select sobol_index from campaign_case
        where (campaign_id, sobol_index) in (select * from unnest($1::text[], $2::bigint[]))
        order by campaign_id, sobol_index for update";
    connection.execute(sql(lock).bind(Value::Texts(campaigns)).bind(indices)).await
}

/// Statement that inserts those passes in `values` (columns `columns` of `result`) that do not exist yet;
/// existing passes of the same cases are kept. It returns the number of inserted passes as `added`.
pub(crate) fn gathering(columns: &str, values: &str) -> String {
    format!(
        "with given ({columns}) as (values {values}),
        here as (
            select {columns} from result
            where (campaign_id, sobol_index) in (select campaign_id, sobol_index from given)),
        added as (
            select distinct on (campaign_id, sobol_index, speed_km_h) * from given
            where (campaign_id, sobol_index, speed_km_h)
                not in (select campaign_id, sobol_index, speed_km_h from here)),
        gathered as (
            insert into case_result (campaign_id, sobol_index, speeds_km_h, levels_dB, duration_s,
                worker, code_version, model_hash, experiment_hash, parameter_hash, finished_at,
                flagged, contact_loss_shares, checksum)
            select campaign_id, sobol_index, speeds_km_h,
                array(select level from unnest(levels) with ordinality as of (level, place)
                    order by place),
                duration_s, worker, code_version, model_hash, experiment_hash, parameter_hash,
                finished_at, flagged, contact_loss_shares, checksum
            from (
                select campaign_id, sobol_index,
                    array_agg(speed_km_h order by speed_km_h) as speeds_km_h,
                    array_agg(array[{levels}] order by speed_km_h) as levels,
                    max(duration_s) as duration_s, max(worker) as worker,
                    max(code_version) as code_version, max(model_hash) as model_hash,
                    max(experiment_hash) as experiment_hash,
                    max(parameter_hash) as parameter_hash, max(finished_at) as finished_at,
                    max(flagged) as flagged,
                    array_agg(contact_loss_share order by speed_km_h) as contact_loss_shares,
                    max(checksum) as checksum
                from (select * from here union all select * from added) as passes
                group by campaign_id, sobol_index) as cases
            on conflict (campaign_id, sobol_index) do update set
                speeds_km_h = excluded.speeds_km_h, levels_dB = excluded.levels_dB,
                contact_loss_shares = excluded.contact_loss_shares, checksum = excluded.checksum
            returning id, campaign_id, sobol_index),
        series as (
            insert into case_series (result_id, speed_km_h, log_power)
            select id, speed_km_h, log_power
            from added join gathered using (campaign_id, sobol_index))
        select count(*) as added from added",
        levels = LEVEL_COLUMNS.join(", ")
    )
}
