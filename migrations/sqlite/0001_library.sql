-- The library: campaigns, their cases, and what came out of each case at each speed.
--
-- Units stand in column names. Hashes are hexadecimal BLAKE3, shortened to 128 bits where there is
-- one a row.

-- Tells a library from any other SQLite database ("twin" in ASCII).
pragma application_id = 0x7477696e;

create table campaign (
    id text not null primary key,
    name text not null,
    -- What decides the cases, and what is done with each; canonical JSON.
    definition text not null,
    definition_hash text not null,
    experiment text not null,
    experiment_hash text not null,
    -- JSON array, ascending.
    speeds_km_h text not null,
    seed integer not null,
    created_at text not null,
    constraint definition_is_json check (json_valid(definition)),
    constraint experiment_is_json check (json_valid(experiment)),
    constraint speeds_are_a_json_array check (json_type(speeds_km_h) = 'array')
) strict;

-- The queue's whole state; nothing of it lives in memory only.
create table campaign_case (
    campaign_id text not null references campaign (id),
    sobol_index integer not null,
    railpad_stiffness_N_m real not null,
    railpad_damping_N_s_m real not null,
    ballast_stiffness_N_m real not null,
    ballast_damping_N_s_m real not null,
    sleeper_EI_N_m2 real not null,
    irregularity_level real not null,
    surface_seed integer not null,
    parameter_hash text not null,
    state text not null default 'waiting',
    -- Leases given so far. It tells a late report from a current one, so it only grows.
    epoch integer not null default 0,
    -- Leases that ended in a failure or in silence; a lease handed back is not counted.
    attempts integer not null default 0,
    -- Who holds it, or held it last.
    worker text,
    -- By the coordinator's clock.
    lease_expires_unix_ms integer,
    -- How the last counted attempt ended.
    error text,
    constraint a_case_has_one_place_in_its_campaign primary key (campaign_id, sobol_index),
    constraint state_is_known check (state in ('waiting', 'leased', 'finished', 'failed')),
    constraint leased_iff_lease_expires check (
        (state = 'leased') = (lease_expires_unix_ms is not null)),
    constraint leased_to_somebody check (state <> 'leased' or worker is not null),
    constraint failed_for_a_reason check (state <> 'failed' or error is not null)
) strict, without rowid;

-- Serves leases (the first waiting cases) and the counts of a campaign's states.
create index campaign_case_by_state on campaign_case (campaign_id, state, sobol_index);

-- Expired leases are looked for at every lease: only what is leased stands here.
create index campaign_case_by_lease on campaign_case (lease_expires_unix_ms)
    where state = 'leased';

create table result (
    campaign_id text not null,
    sobol_index integer not null,
    speed_km_h real not null,
    -- ln LWPS, one a frequency bin of the experiment: doubles, big-endian, so that the sqlite3
    -- shell reads bin k with ieee754_from_blob(substr(log_power, 8 * k + 1, 8)).
    log_power blob not null,
    level_50_Hz_dB real not null,
    level_63_Hz_dB real not null,
    level_80_Hz_dB real not null,
    level_100_Hz_dB real not null,
    level_125_Hz_dB real not null,
    level_160_Hz_dB real not null,
    level_200_Hz_dB real not null,
    level_250_Hz_dB real not null,
    level_315_Hz_dB real not null,
    level_400_Hz_dB real not null,
    level_500_Hz_dB real not null,
    level_630_Hz_dB real not null,
    level_800_Hz_dB real not null,
    level_1000_Hz_dB real not null,
    level_1250_Hz_dB real not null,
    level_1600_Hz_dB real not null,
    level_2000_Hz_dB real not null,
    level_2500_Hz_dB real not null,
    level_3150_Hz_dB real not null,
    level_4000_Hz_dB real not null,
    -- Computing time of the case at all speeds together.
    duration_s real not null,
    worker text not null,
    code_version text not null,
    model_hash text not null,
    experiment_hash text not null,
    parameter_hash text not null,
    finished_at text not null,
    constraint a_case_has_one_result_a_speed unique (campaign_id, sobol_index, speed_km_h),
    constraint a_result_belongs_to_a_case foreign key (campaign_id, sobol_index)
        references campaign_case (campaign_id, sobol_index),
    constraint log_power_holds_doubles check (length(log_power) % 8 = 0)
) strict;

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
