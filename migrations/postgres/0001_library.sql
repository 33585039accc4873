-- The library: campaigns, their cases, and what came out of each case at each speed.
--
-- The same tables, columns and views as with SQLite. Unquoted names are folded to lower case by
-- PostgreSQL, so that a query may spell them as here in both. Texts collate by code point, as
-- SQLite's do, whatever the server's language.
--
-- Units stand in column names. Hashes are hexadecimal BLAKE3, shortened to 128 bits where there is
-- one a row.

create table campaign (
    id text collate "C" not null primary key,
    name text collate "C" not null,
    -- What decides the cases, and what is done with each; canonical JSON.
    definition text collate "C" not null,
    definition_hash text collate "C" not null,
    experiment text collate "C" not null,
    experiment_hash text collate "C" not null,
    -- JSON array, ascending.
    speeds_km_h text collate "C" not null,
    seed bigint not null,
    created_at text collate "C" not null,
    constraint definition_is_json check (definition::jsonb is not null),
    constraint experiment_is_json check (experiment::jsonb is not null),
    constraint speeds_are_a_json_array check (jsonb_typeof(speeds_km_h::jsonb) = 'array')
);

-- The queue's whole state; nothing of it lives in memory only.
create table campaign_case (
    campaign_id text collate "C" not null references campaign (id),
    sobol_index bigint not null,
    railpad_stiffness_N_m double precision not null,
    railpad_damping_N_s_m double precision not null,
    ballast_stiffness_N_m double precision not null,
    ballast_damping_N_s_m double precision not null,
    sleeper_EI_N_m2 double precision not null,
    irregularity_level double precision not null,
    surface_seed bigint not null,
    parameter_hash text collate "C" not null,
    state text collate "C" not null default 'waiting',
    -- Leases given so far. It tells a late report from a current one, so it only grows.
    epoch bigint not null default 0,
    -- Leases that ended in a failure or in silence; a lease handed back is not counted.
    attempts bigint not null default 0,
    -- Who holds it, or held it last.
    worker text collate "C",
    -- By the coordinator's clock.
    lease_expires_unix_ms bigint,
    -- How the last counted attempt ended.
    error text collate "C",
    constraint a_case_has_one_place_in_its_campaign primary key (campaign_id, sobol_index),
    constraint state_is_known check (state in ('waiting', 'leased', 'finished', 'failed')),
    constraint leased_iff_lease_expires check (
        (state = 'leased') = (lease_expires_unix_ms is not null)),
    constraint leased_to_somebody check (state <> 'leased' or worker is not null),
    constraint failed_for_a_reason check (state <> 'failed' or error is not null)
);

-- Serves leases: the first waiting cases.
create index campaign_case_waiting on campaign_case (campaign_id, sobol_index)
    where state = 'waiting';

-- Serves what explains failures.
create index campaign_case_failed on campaign_case (campaign_id, sobol_index)
    where state = 'failed';

-- Expired leases are looked for at every lease: only what is leased stands here.
create index campaign_case_by_lease on campaign_case (lease_expires_unix_ms)
    where state = 'leased';

create table result (
    campaign_id text collate "C" not null,
    sobol_index bigint not null,
    speed_km_h double precision not null,
    -- ln LWPS, one a frequency bin of the experiment: log_power[k] is that of bin k - 1.
    log_power double precision[] not null,
    level_50_Hz_dB double precision not null,
    level_63_Hz_dB double precision not null,
    level_80_Hz_dB double precision not null,
    level_100_Hz_dB double precision not null,
    level_125_Hz_dB double precision not null,
    level_160_Hz_dB double precision not null,
    level_200_Hz_dB double precision not null,
    level_250_Hz_dB double precision not null,
    level_315_Hz_dB double precision not null,
    level_400_Hz_dB double precision not null,
    level_500_Hz_dB double precision not null,
    level_630_Hz_dB double precision not null,
    level_800_Hz_dB double precision not null,
    level_1000_Hz_dB double precision not null,
    level_1250_Hz_dB double precision not null,
    level_1600_Hz_dB double precision not null,
    level_2000_Hz_dB double precision not null,
    level_2500_Hz_dB double precision not null,
    level_3150_Hz_dB double precision not null,
    level_4000_Hz_dB double precision not null,
    -- Computing time of the case at all speeds together.
    duration_s double precision not null,
    worker text collate "C" not null,
    code_version text collate "C" not null,
    model_hash text collate "C" not null,
    experiment_hash text collate "C" not null,
    parameter_hash text collate "C" not null,
    finished_at text collate "C" not null,
    constraint a_case_has_one_result_a_speed unique (campaign_id, sobol_index, speed_km_h),
    constraint a_result_belongs_to_a_case foreign key (campaign_id, sobol_index)
        references campaign_case (campaign_id, sobol_index)
);

-- Doubles don't compress: trying would only cost time.
alter table result alter column log_power set storage external;

-- Every case is updated twice, at its lease and at its end. Room in the pages keeps the new row
-- beside the old one, and vacuum comes before the dead rows at the head of the queue cost anything.
alter table campaign_case set (
    fillfactor = 70, autovacuum_vacuum_scale_factor = 0.02, autovacuum_analyze_scale_factor = 0.05);

-- One row a case and speed: what went in, and what came out.
create view result_with_parameters as
select
    result.campaign_id,
    result.sobol_index,
    result.speed_km_h,
    campaign_case.railpad_stiffness_N_m,
    campaign_case.railpad_damping_N_s_m,
    campaign_case.ballast_stiffness_N_m,
    campaign_case.ballast_damping_N_s_m,
    campaign_case.sleeper_EI_N_m2,
    campaign_case.irregularity_level,
    campaign_case.surface_seed,
    result.level_50_Hz_dB,
    result.level_63_Hz_dB,
    result.level_80_Hz_dB,
    result.level_100_Hz_dB,
    result.level_125_Hz_dB,
    result.level_160_Hz_dB,
    result.level_200_Hz_dB,
    result.level_250_Hz_dB,
    result.level_315_Hz_dB,
    result.level_400_Hz_dB,
    result.level_500_Hz_dB,
    result.level_630_Hz_dB,
    result.level_800_Hz_dB,
    result.level_1000_Hz_dB,
    result.level_1250_Hz_dB,
    result.level_1600_Hz_dB,
    result.level_2000_Hz_dB,
    result.level_2500_Hz_dB,
    result.level_3150_Hz_dB,
    result.level_4000_Hz_dB,
    result.log_power,
    result.duration_s,
    result.worker,
    result.code_version,
    result.model_hash,
    result.experiment_hash,
    result.parameter_hash,
    result.finished_at
from result
join campaign_case using (campaign_id, sobol_index);
