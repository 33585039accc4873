-- The series of a case's passes lie in a table of their own, a row a pass, which stays whole in its page: beside
-- the rest of a case's results they were cut into pieces of 2 kB, each with a place in an index.
-- A row of results no longer has its case looked for (foreign key): whoever stores one has locked its case.

alter table case_result rename to earlier_result;

create table case_result (
    -- For this database alone, to find the series by; a copy has others.
    id bigint not null generated always as identity (cache 32),
    campaign_id text collate "C" not null,
    sobol_index bigint not null,
    -- Ascending; the passes stand in this order in levels.
    speeds_km_h double precision[] not null,
    -- One-third-octave levels of 50 to 4000 Hz in dB, 20 a pass.
    levels_dB double precision[] not null,
    -- Computing time of the case at all speeds together.
    duration_s double precision not null,
    worker text collate "C" not null,
    code_version text collate "C" not null,
    model_hash text collate "C" not null,
    experiment_hash text collate "C" not null,
    parameter_hash text collate "C" not null,
    finished_at text collate "C" not null,
    -- Why a result is doubted; null for most.
    flagged text collate "C",
    constraint results_of_a_case_are_one_row primary key (campaign_id, sobol_index),
    constraint every_pass_has_its_levels check (
        cardinality(speeds_km_h) > 0 and cardinality(levels_dB) = 20 * cardinality(speeds_km_h))
);

create table case_series (
    result_id bigint not null,
    speed_km_h double precision not null,
    -- ln LWPS, big-endian doubles, one a frequency bin of the experiment.
    log_power bytea not null,
    constraint a_pass_has_one_series primary key (result_id, speed_km_h),
    constraint series_are_doubles check (length(log_power) % 8 = 0)
);

-- Doubles don't compress; rows of up to a page are left whole.
alter table case_series alter column log_power set storage external;
alter table case_series set (toast_tuple_target = 8160);

insert into case_result (campaign_id, sobol_index, speeds_km_h, levels_dB, duration_s, worker, code_version,
    model_hash, experiment_hash, parameter_hash, finished_at, flagged)
select campaign_id, sobol_index, speeds_km_h, levels_dB, duration_s, worker, code_version,
    model_hash, experiment_hash, parameter_hash, finished_at, flagged
from earlier_result;

insert into case_series (result_id, speed_km_h, log_power)
select id, speed_km_h, substring(log_power from bytes * (pass - 1) + 1 for bytes)
from earlier_result
join case_result using (campaign_id, sobol_index)
cross join lateral (
    select speed_km_h, cast(place as integer) as pass,
        length(log_power) / cardinality(earlier_result.speeds_km_h) as bytes
    from unnest(earlier_result.speeds_km_h) with ordinality as of (speed_km_h, place)) as passes;

drop view spectrum;
drop view result_with_parameters;
drop view result;
drop table earlier_result;

-- One row a case and speed: what came out. Series are looked up one by one, and only where they are asked for.
create view result as
select
    campaign_id,
    sobol_index,
    speed_km_h,
    (select log_power from case_series
        where case_series.result_id = case_result.id and case_series.speed_km_h = passes.speed_km_h) as log_power,
    levels_dB[20 * pass - 19] as level_50_Hz_dB,
    levels_dB[20 * pass - 18] as level_63_Hz_dB,
    levels_dB[20 * pass - 17] as level_80_Hz_dB,
    levels_dB[20 * pass - 16] as level_100_Hz_dB,
    levels_dB[20 * pass - 15] as level_125_Hz_dB,
    levels_dB[20 * pass - 14] as level_160_Hz_dB,
    levels_dB[20 * pass - 13] as level_200_Hz_dB,
    levels_dB[20 * pass - 12] as level_250_Hz_dB,
    levels_dB[20 * pass - 11] as level_315_Hz_dB,
    levels_dB[20 * pass - 10] as level_400_Hz_dB,
    levels_dB[20 * pass - 9] as level_500_Hz_dB,
    levels_dB[20 * pass - 8] as level_630_Hz_dB,
    levels_dB[20 * pass - 7] as level_800_Hz_dB,
    levels_dB[20 * pass - 6] as level_1000_Hz_dB,
    levels_dB[20 * pass - 5] as level_1250_Hz_dB,
    levels_dB[20 * pass - 4] as level_1600_Hz_dB,
    levels_dB[20 * pass - 3] as level_2000_Hz_dB,
    levels_dB[20 * pass - 2] as level_2500_Hz_dB,
    levels_dB[20 * pass - 1] as level_3150_Hz_dB,
    levels_dB[20 * pass] as level_4000_Hz_dB,
    duration_s,
    worker,
    code_version,
    model_hash,
    experiment_hash,
    parameter_hash,
    finished_at,
    flagged
from case_result
cross join lateral (
    select speed_km_h, cast(place as integer) as pass
    from unnest(speeds_km_h) with ordinality as of (speed_km_h, place)) as passes;

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
    result.finished_at,
    result.flagged
from result
join campaign_case using (campaign_id, sobol_index);

-- One row a case, speed and frequency bin: ln LWPS, in (m/s2)^2. It reads each number where it is stored.
create view spectrum as
select
    case_result.campaign_id,
    case_result.sobol_index,
    case_series.speed_km_h,
    frequency_bin.bin,
    frequency_bin.frequency_Hz,
    double_at(case_series.log_power, frequency_bin.bin + 1) as log_power
from case_result
join case_series on case_series.result_id = case_result.id
join frequency_bin using (experiment_hash);
